"""The scene that a word of a user names."""

from os.path import exists

from polhode.harness.common.near_files import file_hint
from polhode.models.scene import Scene
from polhode.models.scenes import SCENES, find_scene


def scene_named(word: str) -> Scene:
    """The scene of a file, or the built-in one of that name; a ValueError names the file that is near."""
    meant = "" if word in SCENES or exists(word) else file_hint(word)
    if meant:
        raise ValueError(
            f"scene: got {word!r}{meant}, expected a file or a built-in name of `polhode scenes`"
        )
    return find_scene(word)
