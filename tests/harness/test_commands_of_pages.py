"""Commands that README and docs print exist with these options; the quick ones run and print what is shown."""

import re
import shlex
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from commandline import SCENE, SCRIPT, Run

from polhode.harness.cli import COMMANDS, FORMER, polhode

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
# Commands that take seconds, and need no installed plug-in.
QUICK = ("solve", "pick", "draw", "shape", "scenes", "forms", "solvers", "completion", "--help")
PLUG_INS = ("my-quaternion", "my-rk23", "my-decay")

pytestmark = pytest.mark.skipif(not PAGES[0].exists(), reason="no pages here")


def arguments(words: str) -> list[str] | None:
    """What follows `polhode` in a command of the shell; None of another command."""
    parts = shlex.split(words, comments=True)
    while parts and re.fullmatch(r"[A-Z_]+=\S*|source|\$", parts[0]):
        parts.pop(0)
    if not parts or Path(parts[0]).name != "polhode":
        return None
    return parts[1 : parts.index(">") if ">" in parts else None]


def in_blocks() -> Iterator[tuple[str, str]]:
    """Page and command, from blocks of the shell."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for block in re.findall(r"```(?:sh|console)\n(.*?)```", text, re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                if "polhode" in line and '"$(' not in line and arguments(line):
                    yield page.name, line


def within_sentences() -> Iterator[tuple[str, str]]:
    """Page and command, from code within sentences."""
    for page in PAGES:
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        # COMMAND stands for any of several.
        for code in re.findall(r"`((?:\.venv/bin/)?polhode (?!COMMAND)[^`…]+)`", text):
            yield page.name, " ".join(code.split())


def quick() -> list[tuple[str, str]]:
    """Quick commands of blocks, each once."""
    lines = {}
    for page, line in in_blocks():
        words = arguments(line) or []
        if words[0] in QUICK and not set(words) & set(PLUG_INS):
            lines.setdefault(tuple(words), (page, line))
    return list(lines.values())


@pytest.mark.parametrize(("page", "line"), list(dict.fromkeys([*in_blocks(), *within_sentences()])))
def test_a_printed_command_takes_its_options(page: str, line: str):
    words = arguments(line)
    assert words
    name = FORMER.get(words[0], words[0])
    if name.startswith("-"):
        assert name in ("--help", "--version")
        return
    assert name in COMMANDS, page
    command = polhode.get_command(polhode.make_context("polhode", [name]), name)
    assert command is not None
    # Missing arguments are left out within sentences; unknown options are not forgiven.
    parser = command.make_parser(command.context_class(command))
    options, _, _ = parser.parse_args(list(words[1:]))
    known = {parameter.name for parameter in command.params}
    assert set(options) <= known


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the scene of README, and docs."""
    path = tmp_path_factory.mktemp("pages")
    (path / "docs").symlink_to(ROOT / "docs")
    scene = re.search(r"```toml\n(# ice\.toml\n.*?)```", PAGES[0].read_text("utf-8"), re.DOTALL)
    (path / "ice.toml").write_text(scene[1] if scene else SCENE, encoding="utf-8")
    return path


@pytest.mark.parametrize(("page", "line"), quick())
def test_a_quick_command_runs_as_printed(
    page: str, line: str, folder: Path, here: Run, monkeypatch: pytest.MonkeyPatch
):
    words = arguments(line) or []
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder / "docs" / "examples")
    done = here(*words)
    assert done.returncode == 0, f"{page}: {line}\n{done.stderr}"
    assert done.stdout or "--out" in words


def test_pick_prints_what_readme_shows(folder: Path, environment: Mapping[str, str]):
    text = PAGES[0].read_text(encoding="utf-8")
    block = re.search(r"^\$ \S*polhode (.*)\n((?:.*\n)+?)```", text, re.MULTILINE)
    assert block, "the block has changed"
    done = subprocess.run(
        [SCRIPT, *block[1].split()],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )

    def words(line: str) -> str:
        """A line without what differs between machines: the solver and the numbers."""
        line = re.sub(r"\d[\d.e-]*( [µnm]?s)?", "N", line)
        return re.sub(r"by \S+ at", "by S at", line)

    # The README breaks the line as a terminal does.
    shown = words(" ".join(block[2].split())).removesuffix("…").rstrip("; ")
    assert words(done.stdout.splitlines()[0]).startswith(shown)
