"""Standard streams that are closed, full, or that nobody reads: an exit code, no traceback, files of --out whole."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

RUN = ("solve", "paper", "--form", "quaternion", "--solver", "cyrk-vern8", "--tolerance", "1e-6")
# A table, a text of click's, a file, a file on standard output that fills a pipe, and a refusal.
TABLE = (*RUN, "--samples", "9")
FILE = (*TABLE, "--out", "a.csv")
CSV = (*RUN, "--samples", "3000", "--out", "-")
REFUSED = ("solve", "nosuch")
ON_OUTPUT = [TABLE, ("--help",), CSV]


def shell(
    redirection: str, words: tuple[str, ...], folder: Path, environment: Mapping[str, str]
) -> subprocess.CompletedProcess[str]:
    """Run a command with its streams as a shell redirects them."""
    command = f'"$@" {redirection}'
    return subprocess.run(
        ["sh", "-c", command, "sh", sys.executable, "-P", "-m", "polhode", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.fixture(scope="module")
def undisturbed(
    tmp_path_factory: pytest.TempPathFactory, environment: Mapping[str, str]
) -> tuple[bytes, str]:
    """What `FILE` writes into its file, and `TABLE` on standard output, with streams as usual."""
    folder = tmp_path_factory.mktemp("undisturbed")
    assert shell("", FILE, folder, environment).returncode == 0
    table = shell("", TABLE, folder, environment).stdout
    assert table
    return (folder / "a.csv").read_bytes(), table


@pytest.mark.parametrize("words", ON_OUTPUT, ids=["table", "help", "csv"])
@pytest.mark.parametrize("redirection", [">&-", ">/dev/full", "<&- >&-"])
def test_output_that_cannot_be_written_is_a_failure_in_one_line(
    redirection: str, words: tuple[str, ...], tmp_path: Path, environment: Mapping[str, str]
):
    done = shell(redirection, words, tmp_path, environment)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert done.stderr.splitlines()[-1].startswith("polhode: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "redirection", ["2>&-", "2>/dev/full", ">&- 2>&-", "<&- >&- 2>&-", ">/dev/full 2>/dev/full"]
)
def test_a_file_is_whole_whatever_the_streams_are(
    redirection: str, tmp_path: Path, environment: Mapping[str, str], undisturbed: tuple[bytes, str]
):
    done = shell(redirection, FILE, tmp_path, environment)
    assert done.returncode == 0
    assert (tmp_path / "a.csv").read_bytes() == undisturbed[0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.csv.json"]


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full"])
def test_without_standard_error_the_output_is_the_same(
    redirection: str, tmp_path: Path, environment: Mapping[str, str], undisturbed: tuple[bytes, str]
):
    done = shell(redirection, TABLE, tmp_path, environment)
    assert (done.returncode, done.stdout) == (0, undisturbed[1])
    assert shell(redirection, REFUSED, tmp_path, environment).returncode == 2


@pytest.mark.parametrize("words", ON_OUTPUT, ids=["table", "help", "csv"])
def test_a_pipe_that_nobody_reads_is_a_failure_without_words(
    words: tuple[str, ...], tmp_path: Path, environment: Mapping[str, str]
):
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-P", "-m", "polhode", *words],
        cwd=tmp_path,
        env=environment,
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
    os.close(writing)
    assert done.returncode == 1
    assert "polhode:" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert "Traceback" not in done.stderr


SAID = """
import sys
from polhode.harness.common.progress import Progress
from polhode.models.files.cached import say
assert sys.stderr is None
with Progress() as progress:
    progress.begin("something")
say("nobody hears this")
print("done")
"""


def test_a_process_without_standard_error_may_say_things(tmp_path: Path):
    done = subprocess.run(
        ["sh", "-c", '"$@" 2>&-', "sh", sys.executable, "-P", "-c", SAID],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "done\n")


WORKERS = """
import sys
from polhode.harness.common.streams import prepare_streams
from polhode.harness.common.worker import Worker
if __name__ == "__main__":
    prepare_streams()
    with Worker() as worker, open("a.txt", "w") as file:
        file.write(str(worker.run(abs, -3, limit=60.0).value))
"""


@pytest.mark.parametrize("redirection", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_workers_run_though_streams_are_closed(redirection: str, tmp_path: Path):
    (tmp_path / "program.py").write_text(WORKERS, encoding="utf-8")
    done = subprocess.run(
        ["sh", "-c", f'"$@" {redirection}', "sh", sys.executable, "program.py"],
        cwd=tmp_path,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "3"
