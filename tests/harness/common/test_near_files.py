"""Mistyped paths, and the file that is near."""

from pathlib import Path

import pytest

from polhode.harness.common.near_files import file_hint


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("icee.toml", "ice.toml"),
        ("scenes/needel.toml", "scenes/needle.toml"),
        ("scens/needle.toml", "scenes/needle.toml"),
        ("s/ice.toml", "ice.toml"),
    ],
)
def test_the_nearest_file_of_the_same_ending_is_named(
    word: str, meant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("scenes").mkdir()
    for name in ("ice.toml", "icee.csv", "scenes/needle.toml"):
        Path(name).touch()
    assert file_hint(word) == f" (did you mean {meant!r}?)"


@pytest.mark.parametrize("word", ["", "ice", "fog.toml", "x" * 5000 + ".toml", "a\0b.toml", "a.[b"])
def test_without_a_near_file_nothing_is_said(
    word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("ice.toml").touch()
    assert file_hint(word) == ""
