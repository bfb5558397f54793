"""TOML files: what is wrong with them in one line, under their own name."""

from pathlib import Path
from typing import Any

import pytest

from polhode.models.files.toml_file import read_toml


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "some.toml"
    path.write_text("length = 3\n", encoding="utf-8")
    return path


def twice(contents: dict[str, Any]) -> int:
    if contents["length"] < 0:
        raise ValueError(f"length: got {contents['length']}, expected a positive number")
    return 2 * contents["length"]


def test_what_is_made_of_the_contents_comes_back(path: Path):
    assert read_toml(path, twice) == 6


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        (b"length = ", "some.toml: expected a TOML file: Invalid value (at end of document)"),
        (b"length = '\xff'", "some.toml: expected a TOML file: 'utf-8' codec can't decode"),
        (b"length = -3", "some.toml: length: got -3, expected a positive number"),
    ],
)
def test_complaints_name_the_file(path: Path, contents: bytes, message: str):
    path.write_bytes(contents)
    with pytest.raises(ValueError) as complaint:  # noqa: PT011
        read_toml(path, twice)
    assert message in str(complaint.value)
    assert str(complaint.value).startswith(str(path.parent))
    with pytest.raises(ValueError, match=r"^study 'x': "):
        read_toml(path, twice, where="study 'x'")


def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path):
    with pytest.raises(FileNotFoundError):
        read_toml(tmp_path / "none.toml", twice)
