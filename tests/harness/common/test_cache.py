"""The cache of references: what comes back is what was kept, or nothing."""

import os

import numpy as np
import pytest

from polhode.harness.common import cache

ARRAYS = {"x": np.arange(5) / 7, "name": np.array("quaternion")}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    return tmp_path


def test_arrays_come_back_bit_by_bit():
    cache.save("abc", ARRAYS)
    found = cache.load("abc")
    assert found is not None
    assert found["x"].tobytes() == ARRAYS["x"].tobytes()
    assert str(found["name"]) == "quaternion"
    assert cache.load("other") is None


def damage_flip(content: bytes) -> bytes:
    return content[:-10] + bytes([content[-10] ^ 1]) + content[-9:]


@pytest.mark.parametrize(
    "damage", [damage_flip, lambda content: content[:100], lambda content: b""]
)
def test_a_damaged_file_is_noticed_named_and_removed(damage, capsys):
    cache.save("abc", ARRAYS)
    path = cache.path_of("abc")
    path.write_bytes(damage(path.read_bytes()))
    assert cache.load("abc") is None
    output = capsys.readouterr()
    assert str(path) in output.err
    assert "damaged" in output.err
    assert not output.out
    assert not path.exists()


def test_a_file_under_another_name_is_not_used():
    cache.save("abc", ARRAYS)
    cache.path_of("abc").rename(cache.path_of("xyz"))
    assert cache.load("xyz") is None


def test_nothing_but_the_file_is_left_behind(folder):
    cache.save("abc", ARRAYS)
    assert [path.name for path in (folder / "references").iterdir()] == ["abc.reference"]


def test_a_folder_that_cannot_be_written_is_no_error(folder):
    (folder / "references").write_text("a file where a folder should be")
    cache.save("abc", ARRAYS)
    assert cache.load("abc") is None


def test_a_write_that_fails_leaves_nothing_behind(folder, monkeypatch):
    def fail(*names: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    cache.save("abc", ARRAYS)
    assert list((folder / "references").iterdir()) == []


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"POLHODE_CACHE": "/x"}, "/x"),
        ({"XDG_CACHE_HOME": "/y"}, "/y/polhode"),
        ({"HOME": "/z"}, "/z/.cache/polhode"),
        ({"XDG_CACHE_HOME": "."}, "{here}/polhode"),
        ({"HOME": "~"}, "/dev/null/.cache/polhode"),  # As of a user without one.
    ],
)
def test_the_folder_is_where_the_environment_says(variables, expected, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("POLHODE_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert str(cache.cache_folder()) == expected.format(here=tmp_path)
