"""polhode on ARM under emulation: Debian's Python for aarch64 and the wheels, run by QEMU.

QEMU is called by name, so that the kernel need not know of it (binfmt_misc). Needs `debootstrap` and
`qemu-user-static` (Debian). Ten minutes. CyRK has no wheel for Linux on ARM: it is
compiled here, in half of that time, if Debian's `g++-aarch64-linux-gnu` is installed.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

from versions.platforms import on_platform
from versions.tools import (
    BUILD,
    ROOT,
    SAID_LETTERS,
    SETUP_LIMIT,
    SMOKE,
    VERSION_LIMIT,
    Found,
    answers_of,
    ran,
)

QEMU = "qemu-aarch64-static"
COMMANDS = (QEMU, "debootstrap", "dpkg")
# What Debian's compilers for ARM, and files of compiled modules, have in their names.
TARGET = "aarch64-linux-gnu"
COMPILER = f"{TARGET}-g++"
# Debian's release, its Python, and the wheels that its C library takes.
SUITE = "bookworm"
PYTHON = "3.11"
TAGS = ("manylinux_2_28_aarch64", "manylinux_2_27_aarch64", "manylinux_2_17_aarch64")
FOLDER = BUILD / "aarch64"
# Seconds in which CyRK is compiled, and in which all steps are taken under emulation: both take minutes.
SECONDS = 3600.0
# Largest difference from this machine's numbers that is allowed, over the largest of them, by the kind of
# step. Compilers round in other orders, so that runs of tolerance 1e-8 take other steps: estimates. What is
# counted has to be equal.
APART = {"form": 1e-6, "solver": 1e-4, "solve": 1e-6, "pick": 0.0, "solve_ivp": 1e-6}
APART["WorkPrecision"] = 0.0


def missing_commands() -> list[str]:
    """Commands that are not installed here."""
    return [name for name in COMMANDS if shutil.which(name) is None]


def root() -> Path:
    """A folder with Debian's Python for aarch64 and what it links to; made once."""
    there = FOLDER / "root"
    if (there / "usr" / "include" / f"python{PYTHON}" / "Python.h").exists():
        return there
    packages = FOLDER / "packages"
    shutil.rmtree(FOLDER, ignore_errors=True)
    words = ["--arch=arm64", "--foreign", "--variant=minbase"]
    words.append(f"--include=python{PYTHON},libpython{PYTHON}-dev")
    ran("debootstrap", *words, SUITE, packages, seconds=SETUP_LIMIT)
    for archive in sorted((packages / "var/cache/apt/archives").glob("*.deb")):
        ran("dpkg", "-x", archive, there, seconds=SETUP_LIMIT)
    shutil.rmtree(packages)
    return there


def site(packages: list[str]) -> Path:
    """A folder with the wheels of requirements for aarch64."""
    there = FOLDER / "site"
    shutil.rmtree(there, ignore_errors=True)
    words = ["install", "--quiet", "--no-compile", "--only-binary", ":all:", "--target", there]
    words += ["--implementation", "cp", "--python-version", PYTHON]
    for tag in TAGS:
        words += ["--platform", tag]
    ran(sys.executable, "-m", "pip", *words, *packages, seconds=SETUP_LIMIT)
    return there


def add_cyrk(version: str, system: Path, packages: Path) -> str:
    """Compile CyRK for ARM from its source distribution, and unpack it among the wheels; what was done.

    pip calls the result a wheel for this machine's processor, so that no cache may keep it.
    """
    if shutil.which(COMPILER) is None:
        return f"{COMPILER}: not installed (apt install g++-{TARGET})"
    include = system / "usr" / "include"
    headers = [f"-I{packages / 'numpy' / '_core' / 'include'}", f"-I{include / f'python{PYTHON}'}"]
    # Debian's pyconfig.h includes one of these by the processor. The compiler has all else itself.
    headers += ["-idirafter", str(include)]
    surroundings = {
        **os.environ,
        # Compilers for ARM refuse the options of AVX2.
        "CYRK_NO_AVX2": "1",
        "CC": f"{TARGET}-gcc",
        "CXX": COMPILER,
        "LDSHARED": f"{TARGET}-gcc -shared",
        "LDCXXSHARED": f"{COMPILER} -shared",
        # Found before the headers of this machine's Python and NumPy.
        "CFLAGS": " ".join(headers),
        "SETUPTOOLS_EXT_SUFFIX": f".cpython-{PYTHON.replace('.', '')}-{TARGET}.so",
    }
    there = FOLDER / "compiled-wheels"
    shutil.rmtree(there, ignore_errors=True)
    words = ["wheel", "--quiet", "--no-cache-dir", "--no-deps", "--no-binary", "CyRK"]
    words += ["--wheel-dir", there, f"CyRK=={version}"]
    ran(sys.executable, "-m", "pip", *words, seconds=SECONDS, environment=surroundings)
    for wheel in there.glob("*.whl"):
        with ZipFile(wheel) as archive:
            archive.extractall(packages)
    compiler = ran(COMPILER, "-dumpfullversion", seconds=VERSION_LIMIT).strip()
    return f"{version}, compiled by {COMPILER} {compiler}"


def smoke(python: list[str | Path], surroundings: dict[str, str]) -> dict[str, dict]:
    """What the steps answer under a Python."""
    done = subprocess.run(
        [*python, SMOKE],
        cwd=FOLDER,
        env=surroundings,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    answers = answers_of(done.stdout)
    if not answers:
        raise RuntimeError(done.stderr[-SAID_LETTERS:])
    return answers


def difference(one: list[float], other: list[float]) -> float:
    """Largest difference of two rows of numbers, over the largest number."""
    size = max(map(abs, other)) or 1.0
    return max(abs(a - b) for a, b in zip(one, other, strict=True)) / size


def compared(there: dict[str, dict], here: dict[str, dict]) -> tuple[list[str], dict[str, float]]:
    """What is wrong with the answers there, and how far each kind of step is from here at most."""
    wrong = [f"{step} did not run" for step in here if step not in there]
    apart: dict[str, float] = {}
    for step, answer in there.items():
        if "fault" in answer:
            wrong.append(f"{step}: {answer['fault']}")
        if "numbers" not in answer or "numbers" not in here[step]:
            continue
        kind = step.partition(" ")[0]
        found = difference(answer["numbers"], here[step]["numbers"])
        apart[kind] = max(found, apart.get(kind, 0.0))
        if found > APART[kind]:
            wrong.append(f"{step}: {found:.1e} from here, expected {APART[kind]:.0e} at most")
    return wrong, apart


def resolved(platform: str) -> Found:
    """The versions that uv resolves for a platform."""
    versions = on_platform(platform)
    if "why" in versions:
        raise RuntimeError(versions["why"])
    return versions


def installation() -> tuple[Path, Path, str]:
    """A folder with Debian's Python, one with polhode's requirements, and what was done about CyRK."""
    system = root()
    requirements = [f"{name}=={version}" for name, version in resolved("Linux, ARM").items()]
    # CyRK requires Numba, which has a wheel.
    packages = site([*requirements, "numba"])
    return system, packages, add_cyrk(resolved("Linux, x86-64")["cyrk"], system, packages)


def run() -> Found:
    """What runs on aarch64 under emulation; "why" says what is wrong, or why nothing ran."""
    lacking = missing_commands()
    if lacking:
        names = "apt install debootstrap qemu-user-static"
        return {"why": f"{', '.join(lacking)}: not installed ({names})"}
    try:
        system, packages, cyrk = installation()
    except RuntimeError as error:
        return {"why": str(error)}
    home = {"PATH": os.environ["PATH"], "LANG": "C.UTF-8", "PYTHONPATH": str(ROOT / "typings")}
    home["HOME"] = str(FOLDER)
    caches = {name: FOLDER / f"cache-{name}" for name in ("here", "there")}
    for cache in caches.values():
        # What an earlier run has compiled would save this one time.
        shutil.rmtree(cache, ignore_errors=True)
    here = smoke([sys.executable], {**home, "POLHODE_CACHE": str(caches["here"])})
    emulated = {
        **home,
        "POLHODE_CACHE": str(caches["there"]),
        "PYTHONHOME": str(system / "usr"),
        "PYTHONPATH": f"{packages}:{ROOT / 'typings'}",
        # Compiled modules of the checkout stay those of this machine's Python.
        "PYTHONPYCACHEPREFIX": str(FOLDER / "compiled"),
    }
    interpreter = system / "usr" / "bin" / f"python{PYTHON}"
    there = smoke([QEMU, "-L", system, interpreter], emulated)
    wrong, apart = compared(there, here)
    works = [step for step, answer in there.items() if "numbers" in answer]
    refused = [step for step, answer in there.items() if "refused" in answer]
    found = {
        "cyrk": cyrk,
        "works": ", ".join(works),
        "refused": ", ".join(refused),
        "seconds": f"{sum(answer['seconds'] for answer in there.values()):.0f}",
        "apart": ", ".join(f"{kind} {number:.1g}" for kind, number in apart.items()),
    }
    return {**found, "why": "; ".join(wrong)} if wrong else found
