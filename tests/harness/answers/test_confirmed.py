"""The error with every answer: a second run confirms it, and it bounds the true one all along."""

import json
from dataclasses import replace
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

from polhode import BodyStart, Ellipsoid, EulerStart, Scene, SceneSolution, pick, solve
from polhode.harness.answers import confirmed, runs
from polhode.harness.answers.fitted import factors
from polhode.harness.answers.statement import UNKNOWN
from polhode.harness.references.errors import errors
from polhode.models.scene import SlowStart
from polhode.models.scenes import find_scene, named_scene

pytestmark = pytest.mark.usefixtures("quickly_compiled")

TIGHT = {"form": "quaternion", "solver": "cyrk-vern8", "tolerance": 1e-15, "estimate": False}
HERE = Path(__file__).parent


def largest(found: SceneSolution, true: SceneSolution) -> tuple[float, float]:
    """Error of L and E and error of the orientation, 0 where there is none."""
    off = errors(found.scene.ellipsoid, found.observables, true.observables)
    return off.slow, off.orientation or 0.0


@pytest.mark.parametrize(
    ("name", "form", "method", "tolerance", "kind"),
    [
        ("paper", "quaternion", "cyrk-dop853", 1e-8, "looser"),
        ("paper", "quaternion", "cyrk-vern8", 1e-4, "sharper"),
        ("paper", "quaternion", "cyrk-tsit5", 1e-5, "unlike"),
        ("paper", "euler-angles", "cyrk-vern8", 1e-10, "unlike"),
        ("paper", "quaternion", "dop853", 1e-6, "unlike"),
        ("paper", "quaternion", "taylor", 1e-7, "unlike"),
        ("paper", "averaged", "cyrk-dop853", 1e-6, "unlike"),
        ("spheroid", "spheroid-axis", "cyrk-lsoda", 1e-8, "unlike"),
        ("spheroid", "spheroid-axis", "splitting", 1e-8, "looser"),
        ("spheroid", "spheroid-axis", "splitting-extended", 1e-8, "looser"),
        ("stiff", "quaternion", "cyrk-radau", 1e-8, "looser"),
        ("near-spheroid", "quaternion", "cyrk-vern7", 1e-9, "looser"),
    ],
)
def test_a_run_at_a_given_tolerance_is_confirmed_by_a_second_one(
    name, form, method, tolerance, kind
):
    found = solve(name, form=form, solver=method, tolerance=tolerance)
    sharp = TIGHT if name != "stiff" else {**TIGHT, "solver": "cyrk-lsoda"}
    slow, angle = largest(found, solve(name, **sharp))
    assert (found.error.kind, found.error.advice, found.tolerance) == (kind, "", tolerance)
    assert found.error.slow is not None
    assert slow <= found.error.slow.high <= 300 * slow
    if found.error.orientation is not None:
        assert angle <= found.error.orientation.high


@pytest.mark.parametrize("want", ["slow", "orientation"])
@pytest.mark.parametrize(("name", "error"), [("paper", 1e-4), ("spheroid", 1e-9), ("stiff", 1e-7)])
def test_an_answer_meets_the_error_and_says_so(name, error, want):
    found = solve(name, error=error, want=want)
    sharp = TIGHT if name != "stiff" else {**TIGHT, "solver": "cyrk-lsoda"}
    slow, angle = largest(found, solve(name, **sharp))
    stated = found.error.of(want)
    assert (found.error.kind, found.error.advice) == ("tighter", "")
    assert stated is not None
    assert (slow if want == "slow" else angle) <= stated.high <= error


@pytest.mark.parametrize(
    ("axes", "rates", "stokes", "slow_time"),
    [
        ((1.0, 0.8, 0.5), (1.0, 1.0, -1.0), 10.0, 5.0),
        ((1.0, 1.0, 0.5), (1.0, 1.0, 1.0), 100.0, 1.0),
    ],
)
def test_few_rows_state_what_many_rows_state(axes, rates, stokes, slow_time):
    """Of a body that settles the last row lies at the stable node, where errors are forgotten."""
    start = EulerStart((np.pi / 3, np.pi / 6, 0.0), rates)
    scene = Scene(Ellipsoid(axes), stokes, start, stokes * slow_time)
    times = np.linspace(0, scene.time, 801)
    true = solve(scene, **{**TIGHT, "solver": "taylor"}, times=times)
    few, many = (solve(scene, error=1e-6, samples=samples) for samples in (2, 2001))
    assert few.tolerance == many.tolerance
    assert few.error.slow == many.error.slow
    assert few.error.orientation == many.error.orientation
    between = few(times)
    off = np.abs(between.observables.slow - true.observables.slow) / max(scene.ellipsoid.inertia)
    assert off.max() <= few.error.slow.high <= 1e-6
    # Row by row, and between the rows.
    assert between.error.along.slow.shape == (801,)
    assert np.all(off.max(axis=1) <= between.error.along.slow)
    assert between.error.along.slow.max() == pytest.approx(few.error.slow.high, rel=0.1)
    assert few.error.along.slow.shape == (2,)
    assert few.error.along.slow[-1] < few.error.slow.high


@pytest.mark.parametrize("case", json.loads((HERE / "splitting_scenes.json").read_text()))
def test_splitting_states_an_error_of_the_whole_run(case):
    k = case["k"]
    axes = tuple(case.get("ax") or ((1.0, 1.0, k) if k < 1 else (1 / k, 1 / k, 1.0)))
    start = BodyStart(tuple(case["q"]), tuple(case["w"]))
    scene = Scene(Ellipsoid(axes), case["St"], start, case["t"])
    rows = {"form": "spheroid-axis", "samples": case["m"]}
    true = solve(scene, **rows, solver="taylor", tolerance=1e-15, estimate=False)
    found = solve(scene, **rows, solver="splitting", tolerance=case["tol"])
    slow, angle = largest(found, true)
    assert slow <= found.error.slow.high
    assert angle <= found.error.orientation.high


@pytest.mark.parametrize("case", json.loads((HERE / "hybrid_scenes.json").read_text()))
def test_hybrid_states_more_than_its_segments_do(case):
    start = BodyStart(tuple(case["q"]), tuple(case["w"]))
    scene = Scene(Ellipsoid(tuple(case["ax"])), case["St"], start, case["t"])
    found = solve(scene, form="hybrid", solver=case["solver"], tolerance=case["tol"])
    sharp = {"solver": "taylor", "tolerance": 1e-16} if case["St"] > 1 else {"solver": "cyrk-lsoda"}
    slow, _ = largest(found, solve(scene, **{**TIGHT, **sharp}))
    assert slow <= 2 * found.error.slow.high


def test_a_busy_machine_gives_the_same_answer(monkeypatch: pytest.MonkeyPatch):
    scene = find_scene(str(HERE / "load.toml"))
    first = solve(scene, error=1.8e-10, samples=501)
    from time import perf_counter

    for module in (
        "solvers.contract",
        "solvers.solve",
        "solvers.segments",
        "harness.answers.confirmed",
    ):
        monkeypatch.setattr(f"polhode.{module}.perf_counter", lambda: 8 * perf_counter())
    again = solve(scene, error=1.8e-10, samples=501)
    method = first.form, first.solver, first.tolerance
    assert method == (again.form, again.solver, again.tolerance)
    assert np.array_equal(first.states, again.states)
    assert first.error.slow == again.error.slow


def test_no_confirmation_no_error_and_why():
    scene = named_scene("paper")
    way = {"form": "quaternion", "solver": "cyrk-vern8", "tolerance": 1e-8}
    assert solve(scene, **way, estimate=False).error is not None
    assert solve(scene, **way, estimate=False).error.note == UNKNOWN.note
    assert solve(scene, **way, estimate=False).error.kind is None


def test_second_runs_that_end_too_early_confirm_nothing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(runs, "MAX_STEPS", 10)
    monkeypatch.setattr(runs, "STEP_RATIO", 0)
    found = solve("paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-8)
    assert found.success
    assert (found.error.slow, found.error.kind) == (None, None)
    assert found.error.note == "not confirmed: no second run came to its end"
    answer = solve("paper", error=1e-6)
    assert answer.success
    assert answer.error.advice.startswith("the requested error, 1e-6, is not confirmed: not conf")


def test_runs_of_the_same_steps_confirm_nothing(monkeypatch: pytest.MonkeyPatch):
    """A run compared with itself would state no error at all: one by an implicit solver confirms it."""
    scene = replace(named_scene("paper"), time=1e-3)
    found = solve(scene, form="quaternion", solver="cyrk-vern8", tolerance=1e-6)
    assert found.error.note == "unlike: quaternion by cyrk-radau at 1e-07"
    monkeypatch.setattr(confirmed, "IMPLICIT", ("cyrk-vern8",))
    found = solve(scene, form="quaternion", solver="cyrk-vern8", tolerance=1e-6)
    assert (found.error.kind, found.error.note) == (
        None,
        "not confirmed: second runs took too similar steps",
    )


def test_a_run_whose_steps_stability_sets_is_confirmed_by_an_implicit_one():
    """After its 40 damping times no tolerance changes the steps of an explicit method by much."""
    turn = (-0.2892206099472639, 0.0, 0.0, 0.957262471207209)
    start = BodyStart(turn, (0.0, 0.0, 1.0393279580929797))
    scene = Scene(Ellipsoid((1.0, 1.0, 0.2272474459080105)), 4.79, start, 251.4)
    found = solve(scene, error=1.5e-6)
    assert (found.error.kind, found.error.advice) == ("unlike", "")
    slow, _ = largest(found, solve(scene, form="quaternion", solver="taylor", tolerance=1e-14))
    assert slow <= found.error.slow.high <= 1.5e-6


def test_a_solver_that_errs_is_confirmed_by_another_one():
    """Its own runs at other tolerances err alike."""
    way = {"form": "quaternion", "solver": "planted:Steady"}
    found = solve("paper", **way, tolerance=1e-8)
    slow, _ = largest(found, solve("paper", **TIGHT))
    assert found.error.kind == "unlike"
    assert slow <= found.error.slow.high <= 10 * slow
    answer = solve("paper", **way, error=1e-6)
    assert "missed: it is about" in answer.error.advice


def test_a_solver_that_errs_with_its_tolerance_is_run_until_it_meets_the_error():
    found = solve("paper", form="quaternion", solver="planted:FirstOrder", error=1e-6)
    slow, _ = largest(found, solve("paper", **TIGHT))
    assert found.error.kind == "unlike"
    assert slow <= found.error.slow.high <= 1e-6


def test_two_averaging_runs_do_not_confirm_each_other():
    """First-order averaging at St = 1e7 errs by far more than its solver does."""
    start = EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, -1.0))
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 1e6, start, 3e5)
    found = solve(scene, form="averaged", solver="cyrk-vern8", tolerance=1e-10)
    true = solve(scene, form="hybrid", solver="cyrk-vern8", tolerance=1e-9, estimate=False)
    slow, _ = largest(found, true)
    assert slow > 1e-5
    assert found.error.kind == "estimate"
    assert slow <= found.error.slow.high


def test_a_start_by_l_and_e_is_averaged_and_states_its_error():
    scene = replace(named_scene("paper"), stokes=1e5, time=5e3)
    lx, ly, lz = scene.initial.angular_momentum[0].tolist()
    bare = replace(scene, start=SlowStart((lx, ly, lz), float(scene.initial.energy[0])))
    found = solve(bare, error=1e-2)
    assert (found.form, found.error.kind, found.error.advice) == ("averaged", "estimate", "")


@pytest.mark.parametrize("stokes", [0.0, inf])
def test_a_start_by_l_and_e_that_nothing_averages_is_told_what_it_lacks(stokes):
    bare = replace(named_scene("paper"), stokes=stokes, start=SlowStart((0.1, 0.05, -0.2), 0.08))
    for answer in (solve, pick):
        with pytest.raises(ValueError, match="give a start with angles or a quaternion") as refused:
            answer(bare)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("off", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("form", ["euler-top", "quaternion"])
def test_a_torque_free_racket_states_its_error(form, off):
    """About the middle axis, from which it flips; the closed form says how far the run is off."""
    scene = replace(
        named_scene("top"),
        ellipsoid=Ellipsoid((1.0, 0.8, 0.5)),
        start=BodyStart((0.5, 0.5, 0.5, 0.5), (off, 1.0, off)),
        time=200.0,
    )
    found = solve(scene, form=form, solver="taylor", tolerance=1e-11)
    assert found.error.slow.high < 1e-9
    # Next to the unstable rotation the bound may be half a turn, but there is one.
    assert found.error.orientation.high <= pi
    exact = solve(scene, form="euler-top", solver="exact", tolerance=1e-11)
    off_exact = np.abs(found.rotation - exact.rotation).max()
    assert off_exact <= 2 * found.error.orientation.high + exact.error.orientation.high


def test_a_closed_form_has_rounding_alone():
    found = solve("top", form="euler-top", solver="exact", tolerance=1.0)
    assert found.error.kind == "closed form"
    assert 0 < found.error.slow.high < 1e-11


def test_terms_that_cancel_round_by_their_own_size():
    """Without inertia a thin disc hardly turns at some poses, as two terms of the flow's rate cancel."""
    # The axis lies along the gradient of the flow.
    quaternion = EulerStart((pi / 2, 0.0, 0.0)).quaternion
    thin = Scene(Ellipsoid((1.0, 1.0, 0.02)), 0.0, BodyStart(quaternion, (0.0, 0.0, 0.0)), 1e-6)
    error = solve(thin, form="jeffery", solver="exact", tolerance=1.0).error
    size = np.abs(solve(thin, form="jeffery", solver="exact").angular_momentum).max()
    assert size < 1e-3
    assert error.slow.high > 0.1 * np.finfo(float).eps


def test_no_two_orientations_are_further_apart_than_half_a_turn():
    found = solve(replace(named_scene("jeffery"), time=1e18), solver="exact", samples=3)
    assert found.error.orientation.high == np.pi


def test_factors_are_numbers_in_order():
    for families in factors().values():
        for wants in families.values():
            for factor in wants.values():
                assert 0 <= factor.low <= factor.middle <= factor.high
