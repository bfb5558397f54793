"""The package as it is built, imported and committed."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml
from commandline import STUDY
from versions.page import PAGE, page
from versions.pythons import ENDS
from versions.tools import PYTHONS, RESULTS

from polhode.harness.cli import COMMANDS

ROOT = Path(__file__).parents[1]
ROOMS = ("harness", "models", "solvers")
PACKAGES = ("polhode", *ROOMS)
# What a test of the checkout adds is not there where the package is installed.
BARE = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# Beside the folders, what a checkout holds.
TOP_FILES = (
    ".pre-commit-config.yaml",
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "LICENSE",
    "MANIFEST.in",
    "Makefile",
    "README.md",
    "bootstrap.sh",
    "constraints.txt",
    "pyproject.toml",
    "requirements.txt",
    "setup.py",
)
# Seconds since 1970 that a release would give its files.
DATE = "1700000000"
# What belongs to the one who works here, not to the project.
WORKPLACE = re.compile(r"(?<![\w.$}{)/-])/(?:work|tmp|home|root|mnt|Users)/[\w.-]")


def python(code: str, *, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-P", "-c", code]
    return subprocess.run(
        words, cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )


def imported(code: str) -> set[str]:
    """Top-level names of all modules that are loaded once the code has run."""
    done = python(
        f"import sys\n{code}\nprint(' '.join({{name.partition('.')[0] for name in sys.modules}}))"
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def distributions(folder: Path, date: str) -> tuple[Path, Path]:
    """Source distribution, and the wheel made from it, of a copy of the checkout."""
    tree = folder / "tree"
    tree.mkdir(parents=True)
    for name in TOP_FILES:
        shutil.copy(ROOT / name, tree)
    for name in (*PACKAGES, "docs", "tests"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    words = [sys.executable, "-P", "-m", "build", "--no-isolation", "--outdir", str(folder), "."]
    environment = {**BARE, "SOURCE_DATE_EPOCH": date}
    done = subprocess.run(
        words, cwd=tree, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return next(folder.glob("*.tar.gz")), next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Source distribution, and the wheel made from it."""
    return distributions(tmp_path_factory.mktemp("built") / "one", DATE)


def test_the_same_files_and_date_make_the_same_bytes(built: tuple[Path, Path], tmp_path: Path):
    """From a copy made later, by another user's habits."""
    before = os.umask(0o027)
    try:
        again = distributions(tmp_path / "other", DATE)
    finally:
        os.umask(before)
    for one, other in zip(built, again, strict=True):
        assert one.name == other.name
        assert one.read_bytes() == other.read_bytes(), one.name


def in_tree(*folders: str) -> set[str]:
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file()]
    return {str(path.relative_to(ROOT)) for path in files if path.suffix != ".pyc"}


def test_the_wheel_holds_every_file_of_the_packages(built: tuple[Path, Path]):
    with zipfile.ZipFile(built[1]) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
    inside = {
        name if name.startswith("polhode/") else f"polhode/{name}" for name in in_tree(*PACKAGES)
    }
    assert held == inside
    assert {
        "polhode/py.typed",
        "polhode/harness/studies/bench.toml",
        "polhode/harness/answers/methods.toml",
    } <= held


def test_the_source_holds_docs_tests_and_constraints_too(built: tuple[Path, Path]):
    with tarfile.open(built[0]) as source:
        held = {member.name.partition("/")[2] for member in source if member.isfile()}
    assert in_tree(*PACKAGES, "docs", "tests") <= held
    assert {
        "CHANGELOG.md",
        "constraints.txt",
        "requirements.txt",
        "setup.py",
        "pyproject.toml",
        "Makefile",
        "bootstrap.sh",
        "LICENSE",
        "README.md",
    } <= held


@pytest.fixture(scope="module")
def installed(built: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the commands of a fresh environment, where the wheel and what it depends on are installed."""
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], timeout=60, check=True)
    words = [
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--no-warn-script-location",
        str(built[1]),
    ]
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), *words],
        timeout=60,
        check=True,
    )
    (there,) = (folder / "lib").glob("python*/site-packages")
    # The folder's own .pth files, the checkout's among them, are not read from here.
    (there / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return folder / "bin"


def test_the_wheel_works_from_another_folder(installed: Path, tmp_path: Path):
    def polhode(*words: str) -> str:
        done = subprocess.run(
            [installed / "polhode", *words],
            cwd=tmp_path,
            env=BARE,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    code = (
        "import polhode; from polhode.harness.studies.study import read_study; read_study(None, 'regimes')\n"
        "print(polhode.__version__, *polhode.__path__)"
    )
    done = subprocess.run(
        [installed / "python", "-P", "-c", code],
        cwd=tmp_path,
        env=BARE,
        capture_output=True,
        text=True,
        check=True,
    )
    version, *path = done.stdout.split()
    assert version == PROJECT["project"]["version"]
    assert [Path(each).is_relative_to(installed.parent) for each in path] == [True]
    (tmp_path / "small.toml").write_text(STUDY, encoding="utf-8")
    assert "README.md" in polhode(
        "bench",
        "small.toml",
        "--quick",
        "--quiet",
        "--solver",
        "cyrk-vern8",
        "--out",
        "reports/bench",
    )
    assert "polhode solve paper" in polhode("pick", "paper", "--error", "1e-2")
    assert "reports/site/index.html" in polhode("report", "--quiet")


def test_a_plug_in_is_in_every_table(installed: Path, tmp_path: Path):
    """The template of the docs, built and installed beside the wheel."""
    tree = shutil.copytree(ROOT / "docs" / "plug-in", tmp_path / "plug-in")
    python = installed / "python"

    def run(*words: str | Path) -> str:
        done = subprocess.run(
            words, cwd=tmp_path, env=BARE, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    pip = [sys.executable, "-m", "pip", "--python", python]
    run(*pip, "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation", tree)
    # It stays in the fixture's own environment, which goes with the folder.
    assert '"my-quaternion"' in run(installed / "polhode", "forms", "--json")
    way = ("--form", "my-quaternion", "--solver", "my-rk23", "--tolerance", "1e-4")
    assert "11 of 201 rows" in run(installed / "polhode", "solve", "paper", *way)
    code = "from polhode.harness.commands.setup import solver_names as names; print(names(None, None, 'my')[0].value)"
    assert run(python, "-c", code) == "my-rk23\n"
    words = (
        "bench",
        "--problems",
        "--quick",
        "--quiet",
        "--scene",
        "my-decay",
        "--solver",
        "my-rk23",
        "--out",
        "b",
    )
    run(installed / "polhode", *words)
    assert "| my-decay" in (tmp_path / "b" / "README.md").read_text()


def test_version_and_date_are_the_same_everywhere():
    version = PROJECT["project"]["version"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (cited,) = re.findall(r"^version: (\S+)$", citation, re.MULTILINE)
    (released,) = re.findall(r"^date-released: (\d{4}-\d\d-\d\d)$", citation, re.MULTILINE)
    newest = re.findall(r"^## (.*)$", changes, re.MULTILINE)[0]
    assert cited == version
    assert newest == f"{version}, {released}"


def test_changes_are_grouped():
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = changes.split("\n## ")[1]
    assert re.findall(r"^### (.*)$", newest, re.MULTILINE) == [
        "Added",
        "Changed",
        "Fixed",
        "Removed",
    ]


def test_every_python_that_is_claimed_is_tested():
    classifiers = PROJECT["project"]["classifiers"]
    claimed = re.findall(r"Python :: (3\.\d+)", " ".join(classifiers))
    assert tuple(claimed) == PYTHONS
    first, last = PYTHONS[0], int(PYTHONS[-1].partition(".")[2])
    assert PROJECT["project"]["requires-python"] == f">={first},<3.{last + 1}"
    path = ROOT / ".github" / "workflows" / "ci.yml"
    if not path.is_file():
        pytest.skip("not a clone: a source distribution has no workflows")
    jobs = yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"]
    assert tuple(jobs["test"]["strategy"]["matrix"]["python"]) == PYTHONS
    for words in jobs["versions"]["strategy"]["matrix"]["what"]:
        assert set(words.split()) <= {*PYTHONS, *ENDS, "extras"}


def test_polhode_is_imported_beside_a_clone_of_its_name(tmp_path: Path):
    """A folder without `__init__.py` would be found first, as a package of nothing, but for a line in a .pth file."""
    if not (Path(sysconfig.get_path("purelib")) / "polhode-clone.pth").is_file():
        pytest.skip("this environment was not made by `make setup`, which adds the line")
    (tmp_path / "polhode" / "models").mkdir(parents=True)
    words = [sys.executable, "-c", "import polhode; polhode.solve; print(polhode.__file__)"]
    done = subprocess.run(
        words, cwd=tmp_path, env=BARE, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).name == "__init__.py"


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
    heavy = {
        "scipy",
        "pandas",
        "numpy",
        "matplotlib",
        "pydantic",
        "heyoka",
        "numba",
        "sksundae",
        "CyRK",
        "tqdm",
    }
    assert not imported("\n".join(f"import polhode.{room}" for room in ROOMS)) & heavy


def test_catalogues_are_light():
    heavy = {"scipy", "pandas", "heyoka", "numba", "sksundae", "CyRK", "matplotlib"}
    assert not imported("import polhode.models.catalogue, polhode.solvers.catalogue") & heavy


def running(*commands: list[str]) -> str:
    """Code that runs commands, one after the other."""
    code = "from contextlib import suppress\nfrom polhode.harness.cli import main\n"
    return code + "".join(
        f"with suppress(SystemExit):\n    main({arguments})\n" for arguments in commands
    )


HEAVY = {"scipy", "pandas", "pydantic", "heyoka", "numba", "sksundae", "matplotlib", "tqdm"}


def test_help_and_refusals_are_light():
    found = imported(
        running(["--help"], ["--version"], ["shape"], *([name, "--help"] for name in COMMANDS))
    )
    assert not found & {"numpy", "CyRK", *HEAVY}


def test_shape_and_lists_and_the_default_run_import_what_they_need():
    found = imported(running(["shape", "1", "0.8", "0.5"], ["forms"], ["scenes"], ["solvers"]))
    assert not found & {"llvmlite", "CyRK", *HEAVY}
    default = running(["solve", "paper", "--out", os.devnull])
    # The first run of a shape makes its tables of second order, with SciPy's elliptic functions,
    # and keeps them.
    imported(default)
    found = imported(default)
    assert "CyRK" in found
    assert not found & HEAVY
    # A race makes such tables too; Taylor's method takes part in it.
    race = running(["pick", "paper"])
    imported(race)
    assert not imported(race) & HEAVY - {"heyoka"}


def test_models_need_no_solver_library():
    modules = [path.relative_to(ROOT).with_suffix("") for path in (ROOT / "models").rglob("*.py")]
    names = [".".join(module.parts) for module in modules if module.name != "__init__"]
    found = imported("\n".join(f"import polhode.{name}" for name in names))
    assert not found & {
        "heyoka",
        "numba",
        "sksundae",
        "CyRK",
        "pandas",
        "matplotlib",
        "click",
        "tqdm",
    }


@pytest.mark.parametrize("room", ROOMS)
def test_type_checkers_find_the_rooms(room: str):
    link = ROOT / "typings" / "polhode" / room
    assert link.is_symlink()
    assert link.resolve() == ROOT / room
    assert (ROOT / room / "py.typed").is_file()


def plain_name(requirement: str) -> str:
    """Name of a package as it is compared."""
    return re.sub(r"[-_.]+", "-", re.split(r"[<>=!~ ;\[]", requirement)[0]).lower()


def constrained() -> dict[str, str]:
    """Versions of constraints.txt by the names of the packages."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {plain_name(name): version for name, version in pins}


def test_constraints_hold_names_and_versions_alone():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    pattern = r"[A-Za-z0-9][A-Za-z0-9._-]*==[0-9][0-9A-Za-z.+!]*"
    assert [line for line in pins if not re.fullmatch(pattern, line)] == []
    extras = PROJECT["project"]["optional-dependencies"]
    required = PROJECT["project"]["dependencies"] + extras["dask"] + extras["dev"]
    assert {plain_name(line) for line in required} - set(constrained()) == set()


def test_what_setup_installs_has_hashes_and_the_versions_of_the_constraints():
    """Else `make hashes` is due."""
    text = (ROOT / "requirements.txt").read_text(encoding="utf-8")
    installed = {}
    for entry in text.replace("\\\n", " ").splitlines():
        found = re.fullmatch(
            r"([\w.-]+)==(\S+)(?: ; [^#]*?)?((?:\s+--hash=sha256:[0-9a-f]{64})+)", entry
        )
        assert found, entry[:100]
        installed[plain_name(found[1])] = found[2]
    known = constrained()
    assert {name: known.get(name) for name in installed} == installed
    extras = PROJECT["project"]["optional-dependencies"]
    required = [*PROJECT["project"]["dependencies"], *extras["figures"], *extras["dev"]]
    required += [*extras["site"], *extras["dask"]]
    assert {plain_name(line) for line in required} - {"polhode"} - set(installed) == set()


def test_the_page_of_versions_says_what_ran():
    """`python -m versions` writes both."""
    results = json.loads(RESULTS.read_text(encoding="utf-8"))
    assert PAGE.read_text(encoding="utf-8") == page(results)


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
            f"{path.relative_to(ROOT)}: {line.strip()[:100]}"
            for line in text.splitlines()
            if WORKPLACE.search(line)
        ]
    assert found == []


def test_no_lock_file_or_store_is_committed():
    names = {path.name for path in committed()}
    assert not names & {"uv.lock", "poetry.lock"}
    assert not [name for name in names if name.endswith((".sqlite", ".partial", ".pyc"))]
