"""The scene that a word of a user names."""

import tomllib
from os.path import exists
from pathlib import Path

from polhode.harness.common.near_files import file_hint
from polhode.models import scenes
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


def written_slow_time(word: str) -> float | None:
    """The slow time t/St in the file or the table of a scene; None if that gives `time`.

    Raises as `scene_named` does, which is to come first.
    """
    if exists(word):
        table = tomllib.loads(Path(word).read_text(encoding="utf-8"))
    else:
        file = Path(scenes.__file__).with_suffix(".toml")
        table = tomllib.loads(file.read_text(encoding="utf-8"))[word]
    return table.get("slow_time")
