"""Each library taken away: commands and functions work with what is left, or name what is missing before work.

`make torture` asks all commands; here are those that take no time.
"""

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from hidden import (
    LIBRARIES,
    LONG_COMMANDS,
    QUICK_COMMANDS,
    answers,
    complaint,
    not_installed,
    python,
)
from versions.tools import SMOKE, answers_of

from polhode.models.libraries import KNOWN_LIBRARIES

pytestmark = pytest.mark.usefixtures("quickly_compiled")

every_library = pytest.mark.parametrize("library", LIBRARIES)


@every_library
def test_the_library_is_hidden_indeed(library: str, tmp_path: Path):
    code = (
        "import importlib.util, importlib.metadata\n"
        f"assert importlib.util.find_spec({library!r}) is None\n"
        "try:\n"
        f"    importlib.metadata.version({LIBRARIES[library]!r})\n"
        "except importlib.metadata.PackageNotFoundError:\n"
        f"    import {library}\n"
    )
    done = python(library, tmp_path, "-c", code)
    assert done.returncode == 1
    assert f"ModuleNotFoundError: No module named '{library}'" in done.stderr
    assert library in KNOWN_LIBRARIES


# Without them `solve` chooses and `pick` ranks other methods.
CHOICES = [("solve", "paper", "--samples", "5"), ("pick", "paper", "--json")]
CHOSEN_AMONG = ("CyRK", "heyoka", "llvmlite")


@every_library
def test_commands_work_or_say_before_any_work_what_is_missing(library: str, tmp_path: Path):
    """One process for each library: most of its time goes into imports."""
    refused = {words for words, needs in LONG_COMMANDS.items() if library in needs}
    choices = CHOICES if library in CHOSEN_AMONG else []
    commands = [*QUICK_COMMANDS, *refused, *choices]
    found = dict(zip(commands, answers(library, tmp_path, commands), strict=True))
    complaints = {
        words: text
        for words, answer in found.items()
        if (text := complaint(answer, library, refused=words in refused))
    }
    assert complaints == {}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.toml", "sweep.toml"]
    if choices:
        solved, picked = (found[words] for words in choices)
        assert "Lx" in solved.out
        assert json.loads(picked.out)["ranking"]


# Solvers that are gone with a library.
GONE = {
    "CyRK": ["cyrk-vern8", "cyrk-lsoda"],
    "heyoka": ["taylor"],
    "sksundae": ["cvode-adams", "ida"],
    "llvmlite": ["cyrk-vern8", "splitting", "stroboscopic"],
    "scipy": ["dop853", "lsoda", "stroboscopic"],
}
FUNCTIONS = """
import json
import numpy as np
import polhode
from polhode.models.catalogue import form
from polhode.models.libraries import MissingLibraryError, installed
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve

def oscillator(t, y):
    return [y[1], -y[0]]

said = ""
problem = polhode.Problem.from_function(oscillator, [1.0, 0.0], 10.0)
if installed("pandas"):
    names = ["cyrk-vern8", "cvode-adams", "dop853"]
    study = polhode.WorkPrecision(problem, names, [1e-4], samples=11, quiet=True)
    states, uncertainty = study.reference
    error = np.abs(states[:, 0] - np.cos(study.times)).max()
    assert error <= uncertainty + np.finfo(float).eps, (error, uncertainty)
    assert uncertainty < 1e-9
    statuses = dict(zip(study.frame.solver, study.frame.status))
    assert all((statuses[name] == "reached_end") is solver(name).available for name in names)
else:
    try:
        polhode.WorkPrecision
    except MissingLibraryError as error:
        said = str(error)
run = polhode.solve("paper", form="quaternion", tolerance=1e-6, samples=5)
assert run.success, run
if installed("scipy"):
    result = polhode.solve_ivp(oscillator, (0.0, 10.0), [1.0, 0.0], rtol=1e-8)
    assert result.success, result
    assert abs(result.y[0, -1] - np.cos(10.0)) < 1e-5
problem = form("spheroid-axis").problem(named_scene("spheroid"))
statuses = {
    name: solve(problem, name, 1e-4, max_steps=10).status for name in SOLVERS if name != "exact"
}
print(json.dumps([said, statuses, {name: solver(name).why_not for name in statuses}]))
"""


@pytest.mark.parametrize(
    "library",
    [
        "CyRK",
        "heyoka",
        "llvmlite",
        "pandas",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("sksundae", "scipy", "matplotlib", "PIL")
        ),
    ],
)
def test_functions_and_solvers_work_with_what_is_left(library: str, tmp_path: Path):
    done = python(library, tmp_path, "-c", FUNCTIONS)
    assert done.returncode == 0, done.stderr
    said, statuses, why_not = json.loads(done.stdout)
    assert said == (f"WorkPrecision: {not_installed(library)}" if library == "pandas" else "")
    for name, status in statuses.items():
        assert (status == "adapter_missing") is (why_not[name] is not None), name
        assert status != "crashed", name
        assert why_not[name] in (None, not_installed(library)), name
    for name in GONE.get(library, []):
        assert statuses[name] == "adapter_missing", name
    assert GONE.get(library) or set(why_not.values()) == {None}


REFERENCES = """
import json
from dataclasses import replace
from polhode.harness.references.chaos import growth
from polhode.harness.references.reference import reference
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene
scene = named_scene("paper")
found = {}
for stokes, time, name in json.loads(INPUT):
    known = reference(replace(scene, stokes=stokes, time=time), name, 21)
    found[f"{stokes} {name}"] = [
        known.observables.slow.tolist(), known.slow_uncertainty, known.precision
    ]
shadow = growth(form("jeffery").problem(replace(scene, stokes=0.0, time=200.0)), 100)
print(json.dumps([found, shadow.logarithm[-1]]))
"""


def printed_here(code: str):
    """What code prints as JSON in this process, where every library is."""
    out = StringIO()
    with redirect_stdout(out):
        exec(code, {})
    return json.loads(out.getvalue())


def test_references_without_heyoka_keep_their_stated_uncertainty(tmp_path: Path):
    scenes = [[1000.0, 100.0, "quaternion"], [1000.0, 100.0, "averaged"]]
    code = REFERENCES.replace("INPUT", repr(json.dumps(scenes)))
    done = python("heyoka", tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    exact, growth = printed_here(code)
    double, growth_of_neighbours = json.loads(done.stdout)
    for name, (slow, uncertainty, precision) in double.items():
        errors = [
            abs(one - other)
            for row, others in zip(slow, exact[name][0], strict=True)
            for one, other in zip(row, others, strict=True)
        ]
        assert precision == "double"
        assert 0 < max(errors) <= uncertainty < 1e-7, name
    assert growth_of_neighbours == pytest.approx(growth, abs=0.01)


# As on a Mac, and on ARM under Linux. What users call follows in the same process.
NARROW = """
import json
import runpy
import sys
import polhode
from polhode.models.catalogue import FORMS, form
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve
problem = form("spheroid-axis").problem(named_scene("spheroid"))
statuses = {
    name: solve(problem, name, 1e-4, max_steps=10).status for name in SOLVERS if name != "exact"
}
for name in FORMS:
    scene = named_scene("spheroid" if "spheroid" in name else "paper")
    if form(name).takes(scene):
        form(name).problem(scene)
found = polhode.solve("paper", error=1e-6, samples=11)
assert found.success, found
print(json.dumps([statuses, found.error.slow.high]), flush=True)
runpy.run_path(sys.argv[1], run_name="__main__")
"""


@pytest.mark.parametrize(
    "missing",
    [
        pytest.param("heyoka", id="macOS-ARM-and-Windows"),
        pytest.param("CyRK+heyoka", id="macOS-x86-64"),
        pytest.param("CyRK+sksundae", id="Linux-ARM"),
    ],
)
def test_where_long_double_is_double_all_works_with_the_libraries_of_a_platform(
    missing: str, tmp_path: Path
):
    done = python(missing, tmp_path, "-c", NARROW, str(SMOKE), "answers", narrow=True)
    assert done.returncode == 0, done.stderr
    first, _, rest = done.stdout.partition("\n")
    statuses, high = json.loads(first)
    assert statuses["splitting-extended"] == "adapter_missing"
    assert "crashed" not in statuses.values()
    assert 0 < high < 1e-6
    steps = answers_of(rest)
    assert list(steps) == ["solve", "pick", "solve_ivp", "WorkPrecision"], done.stderr
    assert [step for step, answer in steps.items() if "numbers" not in answer] == []


def test_references_in_double_keep_their_stated_uncertainty(tmp_path: Path):
    code = REFERENCES.replace("INPUT", repr(json.dumps([[1000.0, 100.0, "quaternion"]])))
    # Without Pillow nothing changes here.
    done = python("PIL", tmp_path, "-c", code, narrow=True)
    assert done.returncode == 0, done.stderr
    exact, *_ = printed_here(code)[0]["1000.0 quaternion"]
    slow, uncertainty, precision = json.loads(done.stdout)[0]["1000.0 quaternion"]
    assert precision == "double"
    error = np.abs(np.array(slow) - np.array(exact)).max()
    assert 0 < error <= uncertainty < 1e-7


def test_records_have_no_version_of_what_is_not_installed(tmp_path: Path):
    code = (
        "import json\n"
        "from polhode.harness.ensembles.ensemble import Ensemble\n"
        "from polhode.models.shape import Ellipsoid\n"
        "ensemble = Ensemble(Ellipsoid((1.0, 1.0, 2.0)), 10.0, 1.0)\n"
        "print(json.dumps(ensemble.content['versions']))\n"
    )
    versions = json.loads(python("heyoka", tmp_path, "-c", code).stdout)
    assert versions["heyoka"] is None
    assert versions["numpy"]
