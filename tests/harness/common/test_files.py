"""Files are complete, or not there."""

import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest

from polhode.harness.common import files
from polhode.harness.common.files import SUMS, PartialFile, read_file, write_file


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


def test_on_a_full_disk_what_was_written_is_kept_as_partial(tmp_path: Path):
    code = (
        "import resource, signal; from pathlib import Path; from polhode.harness.common.files import PartialFile\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))\n"
        "with PartialFile(Path('a.csv')) as file: file.write('more than ten characters')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "File too large: 'a.csv'" in done.stderr
    assert os.listdir(tmp_path) == ["a.csv.partial"]
    assert (tmp_path / "a.csv.partial").read_text() == "more than "


def test_shared_memory_holds_files_and_no_devices():
    assert PartialFile(Path("/dev/shm/a.csv")).atomic
    assert not PartialFile(Path("/dev/null")).atomic


def test_a_file_whose_checksum_cannot_be_kept_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def full(*where: Path) -> None:
        raise OSError(28, "No space left on device")

    write_file(tmp_path / "a.csv", "old", summed=True)
    (tmp_path / "a.csv.partial").write_text("of another run")
    monkeypatch.setattr(files, "_keep_checksum", full)
    with pytest.raises(OSError, match="No space left"):
        write_file(tmp_path / "a.csv", "new", summed=True)
    assert read_file(tmp_path / "a.csv") == b"old"
    assert sorted(os.listdir(tmp_path)) == [SUMS, "a.csv", "a.csv.partial"]


def test_a_link_stays_and_others_may_read(tmp_path: Path):
    (tmp_path / "target").write_bytes(b"old")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_file(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_bytes() == b"new"
    usual = os.umask(0)
    os.umask(usual)
    assert stat.S_IMODE((tmp_path / "target").stat().st_mode) == 0o666 & ~usual


def test_a_file_whose_checksum_is_kept_is_not_read_if_damaged(tmp_path: Path):
    path = tmp_path / "a.csv"
    for content in ("first\n", "second\n"):
        write_file(path, content, summed=True)
        assert read_file(path) == content.encode()
    write_file(tmp_path / "b.csv", "other", summed=True)
    subprocess.run(["sha256sum", "--check", "--quiet", SUMS], cwd=tmp_path, check=True)
    path.write_text("secone\n", encoding="utf-8")
    with pytest.raises(ValueError, match=f"{path}: fails its checksum in SHA256SUMS"):
        read_file(path)
    assert read_file(tmp_path / "b.csv") == b"other"
    (tmp_path / "c.csv").write_text("of one's own", encoding="utf-8")
    assert read_file(tmp_path / "c.csv") == b"of one's own"


def test_a_file_that_is_replaced_while_it_is_read_is_not_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path, sums, contents = tmp_path / "a.csv", files._sums, iter(["new"])
    write_file(path, "old", summed=True)

    def meanwhile(folder: Path) -> dict[str, list[str]]:
        for content in contents:
            write_file(path, content, summed=True)
        return sums(folder)

    monkeypatch.setattr(files, "_sums", meanwhile)
    assert read_file(path) == b"new"
