"""Which scene a word on the command line means."""

from pathlib import Path

from polhode.models.registry import hint
from polhode.models.scene import Scene
from polhode.models.scenes import SCENES, named_scene


def find_scene(word: str) -> Scene:
    """The scene of a file if one has that name, else the built-in one; raises ValueError if there is neither."""
    path = Path(word)
    if path.exists() and not path.is_dir():
        from polhode.models.files.scene_file import read_scene

        return read_scene(path)
    if word in SCENES:
        return named_scene(word)
    raise ValueError(f"scene: got {word!r}{hint(word, SCENES)}, expected a file or one of {', '.join(SCENES)}")
