"""Files are complete, or not there."""

import os
import stat
from pathlib import Path
from typing import IO

import pytest

from polhode.harness.common.files import PartialFile, write_file


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path):
    with PartialFile(tmp_path / "out.csv") as first, PartialFile(tmp_path / "out.csv") as second:
        first.write("one\n" * 1000)
        second.write("two\n")
        assert not (tmp_path / "out.csv").exists()
    assert (tmp_path / "out.csv").read_text() == "one\n" * 1000
    assert os.listdir(tmp_path) == ["out.csv"]


def fail(file: IO[str]) -> None:
    file.write("half")
    raise ValueError("too much")


def test_a_failure_leaves_the_earlier_file_and_what_was_written(tmp_path: Path):
    (tmp_path / "out.csv").write_text("earlier")
    with pytest.raises(ValueError, match="too much"), PartialFile(tmp_path / "out.csv") as file:
        fail(file)
    assert (tmp_path / "out.csv").read_text() == "earlier"
    assert (tmp_path / "out.csv.partial").read_text() == "half"
    assert sorted(os.listdir(tmp_path)) == ["out.csv", "out.csv.partial"]


def test_a_link_stays_and_others_may_read(tmp_path: Path):
    (tmp_path / "target").write_bytes(b"old")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_file(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_bytes() == b"new"
    usual = os.umask(0)
    os.umask(usual)
    assert stat.S_IMODE((tmp_path / "target").stat().st_mode) == 0o666 & ~usual
