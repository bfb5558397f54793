"""Cache folders: one that somebody else may write is not used, a private one is, and a line says so."""

import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from polhode.models.files import cached

SOMEBODY = 12345


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "above" / "cache"
    folder.mkdir(parents=True, mode=0o700)
    folder.parent.chmod(0o700)
    monkeypatch.setenv("POLHODE_CACHE", str(folder))
    monkeypatch.setattr(cached, "_private_folder", None)
    yield folder
    if cached._private_folder is not None:
        cached._private_folder.cleanup()


def given_away(path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root gives a folder to another user")
    os.chown(path, SOMEBODY, SOMEBODY, follow_symlinks=False)


def foreign(folder: Path) -> None:
    given_away(folder)


def foreign_parent(folder: Path) -> None:
    given_away(folder.parent)


def foreign_link(folder: Path) -> None:
    moved = folder.rename(folder.parent / "moved")
    folder.symlink_to(moved)
    given_away(folder)


def open_to_all(folder: Path) -> None:
    folder.chmod(0o777)


def open_to_the_group(folder: Path) -> None:
    folder.chmod(0o770)


def sticky(folder: Path) -> None:
    """As /tmp: others may write beside the user's folders in it."""
    folder.chmod(0o1777)


def open_parent(folder: Path) -> None:
    folder.parent.chmod(0o777)


def link_into_an_open_folder(folder: Path) -> None:
    elsewhere = folder.parent / "open" / "cache"
    elsewhere.mkdir(parents=True)
    elsewhere.parent.chmod(0o777)
    folder.rename(folder.parent / "moved")
    folder.symlink_to(elsewhere)


UNTRUSTED = (
    foreign,
    foreign_parent,
    foreign_link,
    open_to_all,
    open_to_the_group,
    sticky,
    open_parent,
    link_into_an_open_folder,
)


@pytest.mark.parametrize("spoil", UNTRUSTED)
def test_a_folder_that_others_may_write_is_not_used(
    spoil: Callable[[Path], None], cache: Path, capsys: pytest.CaptureFixture[str]
):
    cached.save("key", np.arange(3.0))
    assert cached.load("key") is not None
    spoil(cache)
    assert cached.load("key") is None
    cached.save("key", np.arange(4.0))
    again = cached.load("key")
    assert again is not None
    assert len(again) == 4
    folder = cached.cache_folder("heyoka")
    assert cache.resolve() not in folder.parents
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    output = capsys.readouterr()
    assert output.err.startswith(f"polhode: {cache}")
    assert output.err.count("\n") == 1
    assert not output.out


def sticky_parent(folder: Path) -> None:
    folder.parent.chmod(0o1777)


def link(folder: Path) -> None:
    moved = folder.rename(folder.parent / "moved")
    folder.symlink_to(moved)


def readable(folder: Path) -> None:
    folder.chmod(0o755)


def absent(folder: Path) -> None:
    folder.rmdir()


@pytest.mark.parametrize("make", [sticky_parent, link, readable, absent])
def test_a_folder_of_the_user_alone_is_used(
    make: Callable[[Path], None], cache: Path, capsys: pytest.CaptureFixture[str]
):
    make(cache)
    cached.save("key", np.arange(3.0))
    assert list((cache / "numbers").iterdir())
    assert cached.cache_folder() == cache
    assert capsys.readouterr().err == ""


def test_folders_are_made_for_the_user_alone_whatever_the_umask(cache: Path):
    before = os.umask(0)
    try:
        cached.make_private(cache / "a" / "b")
    finally:
        os.umask(before)
    for folder in (cache / "a", cache / "a" / "b"):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    cache.chmod(0o777)
    with pytest.raises(PermissionError, match="others may write"):
        cached.make_private(cache / "a")


def test_threads_share_one_private_folder_and_one_line(
    cache: Path, capsys: pytest.CaptureFixture[str]
):
    cache.chmod(0o777)
    with ThreadPoolExecutor(8) as threads:
        folders = set(threads.map(lambda _: cached.cache_folder(), range(64)))
    assert len(folders) == 1
    assert capsys.readouterr().err.count("\n") == 1


CODE = """
from polhode.harness.common import cache
from polhode.solvers.compile import cache_folder, load_heyoka
import numpy as np
heyoka = load_heyoka()
cache.save("a", {"x": np.arange(3.0)})
x = heyoka.make_vars("x")
heyoka.taylor_adaptive([(x, -x)], [1.0])
print(cache_folder())
"""


def test_no_cache_of_a_process_uses_it_and_the_private_one_is_removed(cache: Path):
    cache.chmod(0o777)
    done = subprocess.run(
        [sys.executable, "-P", "-c", CODE], capture_output=True, text=True, check=True
    )
    assert list(cache.iterdir()) == []
    private = Path(done.stdout.strip())
    assert not private.parent.exists()
    assert done.stderr.startswith(f"polhode: {cache}")
    assert done.stderr.count("\n") == 1
