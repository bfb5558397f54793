"""References and forms against whole runs by a program that shares nothing with them (tests/oracle/whole_runs)."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from polhode import BodyStart, Ellipsoid, Scene, solve
from polhode.harness.references.reference import reference
from polhode.models.catalogue import full_form

pytestmark = pytest.mark.usefixtures("quickly_compiled")

FILE = Path(__file__).parents[2] / "oracle" / "whole_runs" / "whole_runs.json"
RUNS = json.loads(FILE.read_text(encoding="utf-8"))
# St up to which a run takes less than a second.
QUICK_STOKES = 1e3
# The stiffest run takes ten seconds; its transient is over within the first of these rows.
STIFF = "disc-rest"
STIFF_ROWS = 3
# An ulp, relative.
ULP = 2.3e-16
# A reference states what half an ulp in the parameters makes; constants of a shape are computed to
# two ulps, so that it may be off the exact scene's by four times that.
CONSTANTS = 4.0
# The two runs of the program round alike: each may err by this many times their distance, as in
# `harness/references/reference.py`.
ALIKE = 3.0


def scene_of(run):
    start = BodyStart(tuple(run["quaternion"]), tuple(run["angular_velocity"]))
    return Scene(Ellipsoid(tuple(run["semi_axes"])), run["stokes"], start, run["time"])


@cache
def truth(name):
    """L, shape (n, 3), and E, shape (n,), over I_max, in long double."""
    run = next(run for run in RUNS if run["name"] == name)
    rows = np.array(run["rows"], dtype=np.longdouble)
    axes = rows[:, 1:10].reshape(-1, 3, 3)
    momentum = rows[:, 10:]
    inertia = np.array(scene_of(run).ellipsoid.inertia, dtype=np.longdouble)
    spin = np.einsum("nij,nj->ni", axes, momentum) / inertia
    energy = np.sum(inertia * spin**2, axis=1) / 2
    return momentum / max(inertia), energy / max(inertia)


def distance(run, observables):
    """Largest difference of L and E over I_max."""
    momentum, energy = truth(run["name"])
    unit = max(scene_of(run).ellipsoid.inertia)
    rows = len(run["rows"])
    off = np.abs(observables.slow[:, :3] / unit - momentum[:rows])
    return float(max(np.max(off), np.max(np.abs(observables.slow[:, 3] / unit - energy[:rows]))))


def marked(runs):
    found = []
    for run in runs:
        slow = run["stokes"] > QUICK_STOKES or run["name"] == STIFF
        found.append(pytest.param(run, id=run["name"], marks=[pytest.mark.slow] if slow else []))
    return found


def begin_of(run, rows):
    """The first rows of a run, as a run of its own."""
    time = run["time"] * (rows - 1) / (len(run["rows"]) - 1)
    return {**run, "time": time, "rows": run["rows"][:rows]}


STIFF_BEGIN = [begin_of(run, STIFF_ROWS) for run in RUNS if run["name"] == STIFF]


def test_every_kind_of_body_start_and_stokes_number_is_there():
    kinds = {scene_of(run).ellipsoid.kind for run in RUNS}
    assert kinds == {"prolate", "oblate", "triaxial"}
    assert {run["name"].rsplit("-", 1)[1] for run in RUNS} == {"rest", "tumbling", "fast"}
    assert {run["stokes"] for run in RUNS} == {1e-3, 1e-1, 1e1, 1e3, 1e5, 1e7}


@pytest.mark.parametrize(
    "run", [*marked(RUNS), *(pytest.param(run, id=f"begin-of-{STIFF}") for run in STIFF_BEGIN)]
)
def test_the_reference_is_known_as_well_as_it_says(run):
    scene = scene_of(run)
    known = reference(scene, full_form(scene), len(run["rows"]))
    size = max(1.0, float(np.max(np.abs(truth(run["name"])[1]))))
    allowed = (
        CONSTANTS * known.slow_uncertainty + ALIKE * run["uncertainty"] * size + 10 * ULP * size
    )
    assert distance(run, known.observables) <= allowed


@pytest.mark.parametrize(
    ("form", "solver"),
    [
        ("quaternion", "cyrk-vern8"),
        ("quaternion", "radau"),
        ("euler-angles", "taylor"),
        ("spheroid-axis", "taylor"),
        ("spheroid-angles", "cyrk-dop853"),
    ],
)
@pytest.mark.parametrize("run", marked([run for run in RUNS if 1 <= run["stokes"] <= QUICK_STOKES]))
def test_forms_err_by_no_more_than_they_state(run, form, solver):
    scene = scene_of(run)
    if form.startswith("spheroid") and scene.ellipsoid.symmetry_axis is None:
        pytest.skip("a form of spheroids alone")
    solution = solve(scene, form=form, solver=solver, tolerance=1e-9, samples=len(run["rows"]))
    assert solution.success
    assert solution.error is not None
    assert distance(run, solution.observables) <= solution.error.slow.high + run["uncertainty"]
