"""The command line as a user runs it: the installed script, an empty home, a folder of its own."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from commandline import SCENE, SCRIPT, Run
from dasks import contact, dask_scheduler, dask_worker
from sites import pages_of, site, small_reports

from polhode.harness.cli import main

# Seconds after which a command is stopped: far more than those of the tests take on a busy machine.
COMMAND_LIMIT = 120


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment with a home of its own, so that nothing of the user's is read or written; the cache is the run's."""
    home = tmp_path_factory.mktemp("home")
    return {**os.environ, "HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache")}


@pytest.fixture
def polhode(tmp_path: Path, environment: dict[str, str]) -> Run:
    """`polhode ARGUMENTS`, run to its end in a folder of the test's own, or in another one."""

    def run(*arguments: object, folder: Path = tmp_path) -> subprocess.CompletedProcess[str]:
        words = [SCRIPT, *map(str, arguments)]
        return subprocess.run(
            words,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=COMMAND_LIMIT,
            check=False,
        )

    return run


@pytest.fixture
def here(
    tmp_path: Path,
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Run:
    """As `polhode`, but in this process, so that what it has imported and compiled need not be again."""
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, environment[name])

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        with pytest.raises(SystemExit) as end:
            main([*map(str, arguments)])
        printed = capsys.readouterr()
        return subprocess.CompletedProcess(
            arguments, int(end.value.code or 0), printed.out, printed.err
        )

    return run


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    """The manual's scene file, alone in the folder where `polhode` runs."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def site_reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Reports of a small study."""
    return small_reports(tmp_path_factory.mktemp("reports"))


@pytest.fixture(scope="session")
def site_folder(tmp_path_factory: pytest.TempPathFactory, site_reports: Path) -> Path:
    """The site made of them."""
    folder = tmp_path_factory.mktemp("site")
    site(folder, site_reports)
    return folder


@pytest.fixture(scope="session")
def site_pages(site_folder: Path) -> dict[str, str]:
    """Its pages by name."""
    return pages_of(site_folder)


@pytest.fixture(scope="module")
def cluster(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """Address of a scheduler on the loopback, and its two workers' processes."""
    pytest.importorskip("distributed")
    folder = tmp_path_factory.mktemp("dask")
    scheduler = dask_scheduler(folder)
    workers = [dask_worker(folder) for _ in range(2)]
    try:
        yield contact(folder), workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()
