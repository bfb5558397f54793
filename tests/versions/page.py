"""The page `docs/versions.md`: what ran, as the results say."""

import re

from versions.emulated import QEMU
from versions.extras import STEPS
from versions.platforms import PLATFORMS
from versions.pythons import ENDS
from versions.tools import PYTHONS, ROOT, SHOWN, Found

PAGE = ROOT / "docs" / "versions.md"
HEAD = """\
# Versions

polhode runs under Python 3.11 to 3.14. `pip install polhode` brings these libraries on each platform, by their wheels
for Python 3.11; a dash is a library that has none there. polhode works without these libraries, and `polhode solvers`
names the solvers that are missing:

"""
PYTHON_HEAD = """
Linux on x86-64 is tested, Linux on ARM under emulation, the others are resolved alone (`make test-versions
VERSIONS=platforms`).

## Each Python, the oldest and the newest versions

`make test-versions` runs the tests under each Python from 3.11 to 3.14 that it finds, with the oldest versions that
`pyproject.toml` admits and that have wheels for it, and with the newest. This is what ran last. Steps are the runs and
calls of `tests/versions/smoke.py` that give numbers: each form, each solver, `solve`, `pick`, `solve_ivp` and
`WorkPrecision`. Python 3.11 runs all tests with the versions of `constraints.txt` at every change (`make test`).

Before SciPy 1.17 LSODA is Fortran, which prints warnings of its own on standard output.

"""
ARM_HEAD = """
## ARM under emulation

`make test-versions VERSIONS=aarch64` unpacks Debian's Python for aarch64 and the wheels beside each other, and has
`qemu-aarch64-static` run each form, each solver and each call there, as `tests/versions/smoke.py` lists them. Numbers
are compared with those of x86-64. Long double is IEEE's quadruple there.

CyRK has no wheel for Linux on ARM. The `setup.py` of CyRK 0.20.0 gives every compiler on Linux `-mavx2`, which those
for ARM refuse unless `CYRK_NO_AVX2=1` is set. With it the command compiles CyRK from its source distribution, if
Debian's `g++-aarch64-linux-gnu` is installed. On ARM itself `CYRK_NO_AVX2=1 pip install cyrk` compiles the same
sources, which has not been tried. CyRK's implicit methods difference the field on ARM: their exact Jacobian needs
x86-64.

"""
EXTRAS_HEAD = """
## Extras

`make test-versions VERSIONS=extras` installs the wheel in fresh environments, with no extra and with each one alone,
and calls what users call. What is refused names in one line the extra that brings it.

"""
NOT_YET = "It has not run yet.\n"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def of_pythons(results: dict[str, Found]) -> str:
    """What ran under each Python at each end."""
    rows = []
    for version in PYTHONS:
        for end in ENDS:
            found = results.get(f"{version} {end}")
            if found is None:
                continue
            tests = re.sub(r" in .*", "", found["tests"])
            numbers = [found.get(name, "–") for name in SHOWN]
            # A note is typed into `results.json` by hand.
            which = "; ".join(filter(None, [found.get("selection", "–"), found.get("note")]))
            steps = found.get("steps", "–")
            rows.append([found.get("python", version), end, steps, tests, which, *numbers])
    head = ["Python", "versions", "steps", "tests", "which tests", *SHOWN]
    return table(head, rows) if rows else NOT_YET


def of_platforms(results: dict[str, Found]) -> str:
    """What each platform gets."""
    rows = []
    for platform in PLATFORMS:
        found = results.get(platform, {})
        rows.append([platform, *(found.get(name, "–") for name in SHOWN)])
    return table(["platform", *SHOWN], rows)


def of_arm(found: Found | None) -> str:
    """What ran under emulation."""
    if found is None or "works" not in found:
        return NOT_YET
    rows = [["CyRK", found.get("cyrk", "–")], ["works", found["works"]]]
    rows.append(["refused by name", found["refused"]])
    rows.append(["largest difference from x86-64, over the largest number", found["apart"]])
    rows.append([f"seconds by `{QEMU}`", found["seconds"]])
    if "why" in found:
        rows.append(["wrong", found["why"]])
    return table(["", ""], rows)


def of_extras(results: dict[str, Found]) -> str:
    """What works with each extra."""
    rows = []
    for version in PYTHONS:
        for extra in STEPS:
            found = results.get(f"{version} extra {extra}")
            if found is not None:
                columns = [found.get(name, "–") for name in ("works", "refused", "why")]
                rows.append([found.get("python", version), extra, *columns])
    return (
        table(["Python", "extra", "works", "refused by name", "wrong"], rows) if rows else NOT_YET
    )


def page(results: dict[str, Found]) -> str:
    """The page of what ran."""
    parts = [HEAD, of_platforms(results), PYTHON_HEAD, of_pythons(results)]
    parts += [ARM_HEAD, of_arm(results.get("aarch64")), EXTRAS_HEAD, of_extras(results)]
    return "".join(parts)
