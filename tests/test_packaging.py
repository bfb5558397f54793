"""The package as it is built, imported and committed."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from polhode.harness.cli import COMMANDS

ROOT = Path(__file__).parents[1]
ROOMS = ("harness", "models", "solvers")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# What belongs to the one who works here, not to the project.
WORKPLACE = re.compile(r"(?<![\w.$}{)/-])/(?:work|tmp|home|root|mnt|Users)/[\w.-]")


def python(code: str, *, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-P", "-c", code]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def imported(code: str) -> set[str]:
    """Top-level names of all modules that are loaded once the code has run."""
    done = python(f"import sys\n{code}\nprint(' '.join({{name.partition('.')[0] for name in sys.modules}}))")
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def test_every_module_lies_in_a_package():
    modules = [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    assert [path for path in modules if not (path.parent / "__init__.py").exists()] == []


def test_data_files_are_packaged():
    patterns = PROJECT["tool"]["setuptools"]["package-data"]["*"]
    data = [path for room in ROOMS for path in (ROOT / room).rglob("*") if path.is_file()]
    others = [path for path in data if path.suffix not in (".py", ".pyc")]
    assert others
    assert [path for path in others if not any(path.match(pattern) for pattern in patterns)] == []


def test_the_command_is_declared():
    assert PROJECT["project"]["scripts"] == {"polhode": "polhode.harness.cli:main"}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_refuses_its_bare_name(room: str, tmp_path: Path):
    shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    done = python(f"import sys; sys.path.insert(0, '.'); import {room}", folder=tmp_path)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last == f"ImportError: this package is imported as 'polhode.{room}', not as '{room}'"


def test_rooms_are_light():
    heavy = {"scipy", "pandas", "numpy", "matplotlib", "pydantic", "heyoka", "numba", "sksundae", "CyRK", "tqdm"}
    assert not imported("\n".join(f"import polhode.{room}" for room in ROOMS)) & heavy


def test_catalogues_are_light():
    heavy = {"scipy", "pandas", "heyoka", "numba", "sksundae", "CyRK", "matplotlib"}
    assert not imported("import polhode.models.catalogue, polhode.solvers.catalogue") & heavy


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["shape"], *([name, "--help"] for name in COMMANDS)])
def test_help_and_refusals_are_light(arguments: list[str]):
    code = f"from polhode.harness.cli import main\ntry:\n    main({arguments})\nexcept SystemExit:\n    pass"
    heavy = {"numpy", "scipy", "pandas", "heyoka", "numba", "sksundae", "CyRK", "matplotlib"}
    assert not imported(code) & heavy


def test_models_need_no_solver_library():
    modules = [path.relative_to(ROOT).with_suffix("") for path in (ROOT / "models").rglob("*.py")]
    names = [".".join(module.parts) for module in modules if module.name != "__init__"]
    found = imported("\n".join(f"import polhode.{name}" for name in names))
    assert not found & {"heyoka", "numba", "sksundae", "CyRK", "pandas", "matplotlib", "click", "tqdm"}


@pytest.mark.parametrize("room", ROOMS)
def test_type_checkers_find_the_rooms(room: str):
    link = ROOT / "typings" / "polhode" / room
    assert link.is_symlink()
    assert link.resolve() == ROOT / room
    assert (ROOT / room / "py.typed").is_file()


def test_constraints_hold_names_and_versions_alone():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert [line for line in pins if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*==[0-9][0-9A-Za-z.+!]*", line)] == []
    pinned = {re.sub(r"[-_.]+", "-", line.partition("==")[0]).lower() for line in pins}
    extras = PROJECT["project"]["optional-dependencies"]
    wanted = PROJECT["project"]["dependencies"] + extras["dask"] + extras["dev"]
    names = {re.sub(r"[-_.]+", "-", re.split(r"[<>=!~ ;\[]", line)[0]).lower() for line in wanted}
    assert names - pinned == set()


def committed() -> list[Path]:
    """Files under version control, and those about to be."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    if done.returncode != 0:
        pytest.skip("not a clone: nothing tells which files are the project's")
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_no_file_names_a_workplace():
    found = []
    for path in committed():
        if path == Path(__file__) or path.is_symlink():
            continue
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found += [
            f"{path.relative_to(ROOT)}: {line.strip()[:100]}" for line in text.splitlines() if WORKPLACE.search(line)
        ]
    assert found == []


def test_no_lock_file_or_store_is_committed():
    names = {path.name for path in committed()}
    assert not names & {"uv.lock", "poetry.lock"}
    assert not [name for name in names if name.endswith((".sqlite", ".partial", ".pyc"))]


def test_module_sizes():
    long = {
        str(path.relative_to(ROOT)): lines
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > 400
    }
    assert long == {}
