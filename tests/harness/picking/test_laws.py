"""Laws against planted ones, against other fits of the same data, and pilots against runs that know better."""

from contextlib import suppress
from dataclasses import replace
from math import exp, inf, pi

import numpy as np
import pytest
from scipy.special import ndtri

from polhode.harness.calibration import HELD_OUT_SEED
from polhode.harness.calibration.fit import (
    FEW_RUNS,
    as_wide_as_alike,
    fit_cost,
    fit_error,
    fit_errors,
    fit_steps,
    refit,
)
from polhode.harness.calibration.samples import Sample
from polhode.harness.calibration.scenes import TRAINING_SEED, questions
from polhode.harness.calibration.training import fast_solvers, forms_for, solvers_for, training
from polhode.harness.common.files import write_file
from polhode.harness.picking import pilot as laws_pilot
from polhode.harness.picking.laws import (
    EPS,
    CostLaw,
    ErrorLaw,
    Interval,
    Load,
    Sensitivity,
    Stray,
    load_laws,
    own_laws_path,
    parse_laws,
)
from polhode.harness.picking.load import held_back, load_of
from polhode.harness.picking.model_error import causes, model_errors
from polhode.harness.picking.pilot import form_sensitivity, oriented, pilot
from polhode.harness.picking.refusals import UnfitError
from polhode.harness.references import rotations
from polhode.harness.references.errors import errors
from polhode.models.catalogue import form, reference_form
from polhode.models.files.scene_file import scene_table
from polhode.models.forms.quaternion import Quaternion
from polhode.models.problem import PlannedPiece
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import solve

SHARP = Stray(-0.1, 0.0, 0.1)
COST = CostLaw(
    fixed=8e-5,
    per_sample=2e-7,
    exponent=-0.15,
    start=1e-5,
    per_rotation=6e-7,
    per_time=3e-7,
    per_damping_time=5e-8,
    stiff_exponent=-0.05,
    stray=SHARP,
    records=1,
)
ERROR = ErrorLaw(
    offset=-0.5,
    order=1.1,
    gain=1.0,
    growth=0.1,
    stiffness=-0.2,
    floor=3.0,
    floor_growth=0.8,
    stray=SHARP,
    records=1,
)


def planted_runs(seed=5, scenes=60, noise=0.08, disturbed=0.05):
    """Runs that follow `COST` and `ERROR` with scatter, some of them slowed down fourfold."""
    random = np.random.default_rng(seed)
    runs = []
    for scene in range(scenes):
        turns, following, stiff = (
            10 ** random.uniform(-1, 4),
            10 ** random.uniform(-1, 2.5),
            10 ** random.uniform(-2, 4),
        )
        load = Load(turns, following, stiff, int(random.choice([51, 201, 501])))
        at = Sensitivity(
            1e-6, 10 ** random.uniform(-7, -3), turns, stiff / 100, 10 ** random.uniform(-1, 1)
        )
        for tolerance in 10.0 ** random.integers(-14, -2, 4):
            slowed = 4.0 if random.random() < disturbed else 1.0
            seconds = COST.seconds(load, tolerance) * exp(noise * random.normal()) * slowed
            error = ERROR.error(at, tolerance) * exp(0.5 * random.normal())
            runs.append(
                Sample(f"scene {scene}", float(tolerance), load, seconds, {"slow": (at, error)})
            )
    return runs


def test_cost_law_is_its_formula():
    load = Load(rotations=1000.0, following=20.0, damping_times=300.0, samples=201)
    by_hand = 8e-5 + 201 * 2e-7 + 1e-8**-0.15 * (1e-5 + 6e-4 + 6e-6) + 300 * 5e-8 * 1e-8**-0.05
    assert COST.seconds(load, 1e-8) == pytest.approx(by_hand)
    assert replace(COST, scale=2.0).seconds(load, 1e-8) == pytest.approx(2 * by_hand)
    assert COST.predict(load, 1e-8).high == pytest.approx(by_hand * exp(0.1))


def test_planted_cost_law_is_found():
    """Parameters that the data determine, despite runs that were slowed down; predictions on scenes not seen."""
    found = fit_cost(planted_runs())
    assert found.fixed == pytest.approx(COST.fixed, rel=0.15)
    assert found.exponent == pytest.approx(COST.exponent, abs=0.01)
    assert found.per_rotation == pytest.approx(COST.per_rotation, rel=0.2)
    assert found.per_damping_time == pytest.approx(COST.per_damping_time, rel=0.5)
    low, high = found.intervals["exponent"]
    assert low < COST.exponent < high
    others = planted_runs(seed=6, disturbed=0.0)
    ratios = [run.seconds / found.predict(run.load, run.tolerance).predicted for run in others]
    assert np.quantile(np.abs(np.log(ratios)), 0.9) < np.log(1.25)


def test_steps_that_were_counted_tell_the_time_more_closely():
    """Their cost is found from runs that counted them; where none did, or they tell less, there is no such law."""
    random, runs = np.random.default_rng(3), planted_runs(disturbed=0.0)
    base, stepped, senseless = fit_cost(runs), [], []
    for run in runs:
        steps, noise = int(10 ** random.uniform(1, 5)), exp(0.02 * random.normal())
        any_run = COST.fixed + COST.per_sample * run.load.samples
        seconds = (any_run + 2e-6 * run.tolerance**-0.1 * steps) * noise
        stepped.append(replace(run, load=replace(run.load, steps=steps), seconds=seconds))
        senseless.append(replace(run, load=replace(run.load, steps=steps)))
    assert base == fit_steps(base, runs)
    assert base == fit_cost(senseless)
    found = fit_steps(replace(base, fixed=COST.fixed, per_sample=COST.per_sample), stepped)
    assert found.step_exponent == pytest.approx(-0.1, abs=0.01)
    assert found.per_step == pytest.approx(2e-6, rel=0.1)
    counted, usual = stepped[0].load, runs[0].load
    assert found.predict(counted, 1e-8).high < 1.1 * found.predict(counted, 1e-8).predicted
    assert found.predict(usual, 1e-8).high == pytest.approx(
        found.predict(usual, 1e-8).predicted * exp(found.stray.high - found.stray.middle)
    )


def test_strays_hold_what_they_say():
    """Of scenes not seen, 95 % lie in the interval, give or take what 240 runs can tell."""
    found = fit_cost(planted_runs(disturbed=0.0))
    others = planted_runs(seed=7, disturbed=0.0)
    intervals = [found.predict(run.load, run.tolerance) for run in others]
    inside = [
        each.low <= run.seconds <= each.high for each, run in zip(intervals, others, strict=True)
    ]
    assert 0.90 <= np.mean(inside) <= 0.99


def test_a_law_of_few_runs_strays_no_less_than_like_ones():
    """By the median of the form's solvers, as far as it has no runs of its own; it never strays less than it did."""
    known = load_laws().methods["quaternion", "taylor"]
    rows = ((10, 1.0), (10, 3.0), (10, 5.0), (10**6, 1.0))
    laws = [
        replace(known, errors={"slow": replace(ERROR, records=n, stray=Stray(-2.0, 0.5, high))})
        for n, high in rows
    ]
    found = [
        as_wide_as_alike(law, [*laws, replace(known, form="averaged")])["slow"].stray
        for law in laws
    ]
    # The median of 0.5, 2.5, 4.5 and 0.5 beyond the middle is 1.5.
    share = FEW_RUNS / (FEW_RUNS + 10)
    assert [each.high for each in found] == pytest.approx(
        [1.0 + share * (1.5 - 0.5), 3.0, 5.0, 1.0], rel=1e-4
    )
    assert {(each.low, each.middle) for each in found} == {(-2.0, 0.5)}


def test_planted_error_law_is_found():
    found = fit_error(planted_runs(), "slow", {})
    assert found.order == pytest.approx(ERROR.order, abs=0.03)
    assert found.gain == pytest.approx(ERROR.gain, abs=0.06)
    assert found.floor * 1000**found.floor_growth == pytest.approx(3.0 * 1000**0.8, rel=0.5)
    assert found.stray.high == pytest.approx(0.5 * 1.96, rel=0.2)
    assert set(fit_errors(planted_runs(), {})) == {"slow", "long slow"}


@pytest.mark.parametrize("error", [1e-2, 1e-6, 1e-10])
def test_tolerance_is_the_loosest_that_meets_the_error(error):
    at = Sensitivity(1e-6, 3e-5, 100.0, 0.1, 1.0)
    assert ERROR.predict(at, ERROR.tolerance(at, error)).high == pytest.approx(error)


def test_no_tolerance_gets_below_rounding():
    at = Sensitivity(1e-6, 3e-5, 1e4, 0.1, 1.0)
    assert ERROR.rounding(at) == pytest.approx(3.0 * EPS * 10001**0.8)
    assert ERROR.tolerance(at, ERROR.rounding(at)) == 0
    assert ERROR.tolerance(replace(at, error=inf), 1e-3) == 0
    assert replace(ERROR, offset=-130.0).tolerance(at, 1e-3) > 1
    assert replace(ERROR, offset=-400.0).tolerance(at, 1e-3) == inf


def test_shipped_laws_survive_a_round_trip_and_know_the_fast_solvers(tmp_path):
    laws = load_laws()
    counted = {
        name: replace(law, cost=replace(law.cost, per_step=1e-6, step_stray=law.cost.stray))
        for name, law in laws.methods.items()
    }
    for each in (laws, replace(laws, methods=counted)):
        each.save(tmp_path / "laws.json")
        assert parse_laws((tmp_path / "laws.json").read_text()) == each
    problem = form("quaternion").problem(named_scene("paper"))
    for solver in fast_solvers():
        with suppress(SolverNotValidError):
            find_solver(solver).check(problem)
            assert ("quaternion", solver) in laws.methods
    with pytest.raises(ValueError, match="got schema 99, expected"):
        parse_laws('{"schema": 99, "methods": [], "source": {}}')


def test_own_laws_come_first_unless_they_are_of_another_version(tmp_path, monkeypatch):
    shipped = load_laws()
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    load_laws.cache_clear()
    try:
        own = replace(shipped, source={"machine": "this one"})
        own.save(own_laws_path())
        assert load_laws() == own
        for content, current in (({"refitted": 7}, True), ({"refitted": 7, "records": 1}, False)):
            scaled = replace(shipped, source=shipped.source | content)
            scaled.save(own_laws_path())
            load_laws.cache_clear()
            assert load_laws() == (scaled if current else shipped)
        for text, expected in (('{"schema": 0}', shipped), ("not JSON", None), ("5", None)):
            write_file(own_laws_path(), text, summed=True)
            load_laws.cache_clear()
            if expected is None:
                with pytest.raises(ValueError, match="remove it to use those of the package"):
                    load_laws()
            else:
                assert load_laws() == expected
    finally:
        load_laws.cache_clear()


def test_another_machine_scales_the_costs():
    """Records of one scene, all of them three times slower than the laws say, and none of LSODA."""
    laws = load_laws()
    scene = named_scene("paper")
    load = load_of(form("quaternion"), "taylor", pilot(scene), 201, 1e-6)
    records = []
    for solver in ("taylor", "cyrk-vern8"):
        for tolerance in (1e-4, 1e-6, 1e-8):
            seconds = 3 * laws.methods["quaternion", solver].cost.predict(load, tolerance).predicted
            case = {
                "scene_name": "paper",
                "scene": scene_table(scene),
                "form": "quaternion",
                "solver": solver,
            }
            records.append(
                {
                    **case,
                    "tolerance": tolerance,
                    "samples": 201,
                    "status": "reached_end",
                    "seconds": seconds,
                }
            )
    slower = refit(laws, records)
    for solver in ("taylor", "cyrk-vern8", "cyrk-lsoda"):
        before, after = (
            each.methods["quaternion", solver].cost.predict(load, 1e-6) for each in (laws, slower)
        )
        assert after.predicted == pytest.approx(3 * before.predicted, rel=1e-3)


@pytest.mark.parametrize("name", ["paper", "rest-500", "tumbler", "jeffery", "top", "needle"])
def test_pilot_knows_its_own_error(name):
    """Against Taylor's method at 1e-14: the gain is the error of the pilot's run at the tolerance that it names."""
    scene = named_scene(name)
    found = pilot(scene)
    assert found.direct
    which = form(reference_form(scene))
    times = np.linspace(0, scene.time, laws_pilot.SAMPLES)
    exact = solve(
        which.problem(scene), "cyrk-radau" if name == "tumbler" else "cyrk-vern8", 1e-13, times
    )
    loose = laws_pilot.follow(which, scene, found.gains["slow"].tolerance)
    own = errors(
        scene.ellipsoid, which.observe(scene, loose.states), which.observe(scene, exact.states)
    )
    assert found.gains["slow"].error == pytest.approx(own.slow, rel=0.1)
    assert "orientation" in found.gains
    assert own.orientation is not None
    if found.gains["orientation"].tolerance == found.gains["slow"].tolerance:
        assert found.gains["orientation"].error == pytest.approx(own.orientation, rel=0.1)


def test_pilots_of_the_same_single_step_do_not_pass_for_exact():
    """Explicit methods take this run of averages in one step down to 1e-8, and turn it by 1e-4 too little."""
    start = BodyStart((0.09, 0.18, 0.42, -0.89), (-0.23, 1.07, 0.22))
    scene = Scene(Ellipsoid((1.0, 0.79, 0.84)), 2.4e6, start, 7.5e4)
    which = form("averaged-second-order")
    found, exact = (
        which.observe(scene, laws_pilot.follow(which, scene, *way).states)
        for way in ((1e-6, "cyrk-vern8"), (1e-13, "cyrk-dop853"))
    )
    own = errors(scene.ellipsoid, found, exact)
    assert own.orientation is not None
    assert own.orientation > 1e-5
    assert form_sensitivity(which, pilot(scene))["orientation"].error == pytest.approx(
        own.orientation, rel=0.5
    )


def test_a_lucky_pilot_is_as_good_as_the_next_one():
    """Two steps to 1e-6, of hardly any error; at 1e-8, and for other solvers, errors are what they usually are."""
    which, start = form("averaged-spheroid"), BodyStart((0.5, 0.5, 0.5, 0.5), (0.3, -0.4, 0.5))
    scene = Scene(Ellipsoid((1.0, 1.0, 0.6)), 4e4, start, 1.3e3)
    exact = which.observe(scene, laws_pilot.follow(which, scene, 1e-14, "taylor").states)
    loose, tight = (
        errors(
            scene.ellipsoid,
            which.observe(scene, laws_pilot.follow(which, scene, tolerance).states),
            exact,
        ).slow
        for tolerance in (1e-6, 1e-8)
    )
    gain = laws_pilot.gains(scene.ellipsoid, laws_pilot.form_ladder(which, scene))["slow"]
    assert loose < laws_pilot.LUCKY * 1e-6
    assert gain == (1e-6, pytest.approx(100 * tight, rel=0.1))


def test_a_form_in_pieces_costs_what_its_windows_do():
    class Pieces(Quaternion):
        def plan(self, scene, tolerance, start_at):
            middle = 0.25 * scene.time
            return PlannedPiece(0.0, middle, 1e-9), PlannedPiece(middle, scene.time, None)

    found = pilot(named_scene("paper"))
    load, full = (load_of(each, "taylor", found, 201, 1e-9) for each in (Pieces(), Quaternion()))
    assert load.following == pytest.approx(found.turned(0.25) * full.rotations, rel=0.1)
    assert load_of(Pieces(), "taylor", found, 201, 1e-4) == load
    assert (load.pieces, load.entered, load.rows, load.tolerance) == (
        1,
        1,
        0.75 * 201,
        pytest.approx(1e-9),
    )
    assert (
        form_sensitivity(Pieces(), found)["slow"].error
        == form_sensitivity(Pieces(), found)["slow"].tolerance
    )
    assert not held_back(Pieces(), "cyrk-vern8", found)


@pytest.mark.parametrize(
    ("method", "tolerance"), [("splitting", 1e-8), ("stroboscopic", 1e-5), ("stroboscopic", 1e-9)]
)
def test_steps_over_many_periods_are_foreseen(method, tolerance):
    scene = replace(named_scene("spheroid"), stokes=1e5, time=4e4)
    problem = form("spheroid-axis").problem(scene)
    done = solve(problem, method, tolerance, np.linspace(0.0, problem.end, 51)).work
    load = load_of(form("spheroid-axis"), method, pilot(scene), 51, tolerance)
    assert done.steps is not None
    assert load.rotations == pytest.approx(done.steps + (done.rejected or 0), rel=0.4)
    assert load.following == pytest.approx(done.inner or 0, rel=0.4)
    assert bool(done.inner) == (method == "stroboscopic")


def test_where_a_run_stands_is_known_from_its_pilot_or_from_its_beginning(monkeypatch):
    scene = named_scene("paper")
    states = solve(
        form("quaternion").problem(scene),
        "cyrk-vern8",
        1e-12,
        np.array([0.0, 0.25, 1.0]) * scene.time,
    ).states
    true = form("quaternion").observe(scene, states).slow[1]
    for most in (5000.0, 30.0):
        monkeypatch.setattr(laws_pilot, "MOST_ROTATIONS", most)
        pilot.cache_clear()
        found = pilot(scene)
        start = found.start_at(0.25 * scene.time)
        assert found.direct == (most > 30)
        assert start is not None
        assert np.allclose(replace(scene, start=start).initial.slow[0], true, rtol=1e-3)
    assert found.start_at(0.9 * scene.time) is None
    pilot.cache_clear()


def test_a_settled_motion_is_off_by_its_phase(monkeypatch):
    """A run four times as long as what was followed: its pilot shows what a radian of phase makes of L and E."""
    monkeypatch.setattr(laws_pilot, "MOST_ROTATIONS", 1000.0)
    scene = replace(named_scene("spheroid"), stokes=1e3, time=5e4)
    laws_pilot.pilot.cache_clear()
    found, which = pilot(scene), form("quaternion")
    laws_pilot.pilot.cache_clear()
    assert found.per_radian is not None
    loose, tight = (
        which.observe(
            scene,
            solve(
                which.problem(scene), "cyrk-vern8", tolerance, np.linspace(0, scene.time, 401)
            ).states,
        )
        for tolerance in (1e-8, 1e-12)
    )
    made = errors(scene.ellipsoid, loose, tight)
    assert made.orientation is not None
    assert made.slow == pytest.approx(found.per_radian * made.orientation, rel=0.5)


def test_chaos_is_told():
    assert pilot(named_scene("jeffery-chaotic")).gains["slow"].error == inf


def test_twin_tells_what_the_whole_run_would(monkeypatch):
    """A run of 800 rotations told from a twin of 100: error gains within a factor 10, model error in its interval."""
    start = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))
    scene = Scene(Ellipsoid((0.7, 1.0, 1.0)), 2e4, start, 6e3)
    whole = pilot(scene)
    monkeypatch.setattr(laws_pilot, "MOST_ROTATIONS", 200.0)
    monkeypatch.setattr(laws_pilot, "TWIN_ROTATIONS", 100.0)
    pilot.cache_clear()
    small = pilot(scene)
    pilot.cache_clear()
    assert whole.direct
    assert small.twin
    assert small.followed.slow_time == pytest.approx(scene.slow_time)
    assert small.rotations == whole.rotations == rotations.rotations(scene)
    assert 0.5 < small.gains["slow"].error / whole.gains["slow"].error < 10
    assert "orientation" in small.gains
    assert "orientation" in whole.gains
    assert 0.5 < small.gains["orientation"].error / whole.gains["orientation"].error < 10
    for name in ("averaged-spheroid", "averaged-second-order"):
        told, known = (model_errors(form(name), each)["slow"] for each in (small, whole))
        assert told is not None
        assert known is not None
        assert told.low <= known.predicted <= told.high


def test_beginning_is_followed_where_there_is_no_slow_motion(monkeypatch):
    """A body that has settled turns too little in a damping time."""
    monkeypatch.setattr(laws_pilot, "MOST_ROTATIONS", 100.0)
    scene = replace(named_scene("paper"), time=2e3)
    found = pilot(scene)
    assert not found.direct
    assert not found.twin
    assert found.followed.time < scene.time


@pytest.mark.parametrize("ellipsoid", [Ellipsoid((1.0, 0.8, 0.5)), Ellipsoid((1.0, 1.0, 2.0))])
def test_a_run_from_rest_is_told_from_a_twin(ellipsoid):
    """It speeds up for a small part of a long run alone: rates at its beginning say nothing of the rest."""
    start = EulerStart((1.0, 0.5, 0.0))
    short, found = (
        pilot(Scene(ellipsoid, 1e5, start, 3e4)),
        pilot(Scene(ellipsoid, 1e8, start, 3e7)),
    )
    assert short.direct
    assert found.twin
    assert found.rotations == pytest.approx(1e3 * short.rotations, rel=0.02)


@pytest.mark.parametrize(
    ("name", "averaged"), [("paper", "averaged"), ("spheroid", "averaged-spheroid")]
)
def test_model_error_is_that_of_tight_runs(name, averaged):
    scene = replace(named_scene(name), stokes=1e4, time=1e3)
    told = model_errors(form(averaged), pilot(scene))["slow"]
    assert told is not None
    seen = []
    for each in (averaged, "quaternion"):
        problem = form(each).problem(scene)
        run = solve(problem, "cyrk-vern8", 1e-13, np.linspace(0, problem.end, 401))
        seen.append(form(each).observe(scene, run.states))
    assert told.low < errors(scene.ellipsoid, *seen).slow < told.high


@pytest.mark.parametrize(
    ("name", "averaged", "word"),
    [
        ("paper", "averaged", "crosses L² = 2EI₂"),
        ("pinch-point", "averaged-spheroid", "pinch point"),
        ("paper-saddle", "averaged", "rotations per damping time"),
    ],
)
def test_what_makes_averaging_poor(name, averaged, word):
    assert any(word in each for each in causes(form(averaged), pilot(named_scene(name))))


def test_averaging_needs_rotations():
    with pytest.raises(UnfitError, match="St is too small"):
        model_errors(form("averaged"), pilot(named_scene("stiff")))


@pytest.mark.parametrize("axes", [(1.0, 0.8, 0.5), (0.5, 1.0, 1.0), (0.4, 1.0, 0.4)])
@pytest.mark.parametrize("share", [0.1, 0.7])
def test_orientation_made_for_a_slow_start_has_its_slow_variables(axes, share):
    ellipsoid = Ellipsoid(axes)
    low, high = min(ellipsoid.inertia), max(ellipsoid.inertia)
    momentum = (0.3, -0.2, 0.5)
    energy = 0.5 * sum(x * x for x in momentum) * (share / low + (1 - share) / high)
    scene = Scene(ellipsoid, 1e3, SlowStart(momentum, energy), 100.0)
    made = oriented(scene).initial
    np.testing.assert_allclose(made.angular_momentum[0], momentum, atol=1e-15)
    assert made.energy[0] == pytest.approx(energy, rel=1e-14)


def test_loads_and_regimes():
    paper, stiff = named_scene("paper"), named_scene("stiff")
    found = pilot(paper)
    load = load_of(form("quaternion"), "taylor", found, 201, 1e-6)
    damping = paper.time * max(paper.ellipsoid.damping) / paper.stokes
    following = paper.time * damping / (paper.time + damping)
    weight = load.rotations / found.rotations
    assert 0.5 < weight < 2
    assert load.following == pytest.approx(weight * following)
    assert 0 <= load.damping_times <= 2 * damping
    assert load.samples == 201
    averaged = load_of(form("averaged"), "taylor", found, 201, 1e-6)
    assert (averaged.following, averaged.damping_times, averaged.samples) == (0.0, damping, 201)
    assert 0 < averaged.rotations < load.rotations
    assert load_of(form("averaged"), "cyrk-radau", found, 201, 1e-6).damping_times == 0.0
    assert form_sensitivity(form("quaternion"), found)["slow"].error == found.gains["slow"].error
    assert held_back(form("quaternion"), "cyrk-vern8", pilot(stiff))
    assert not held_back(form("quaternion"), "cyrk-radau", pilot(stiff))
    assert not held_back(form("quaternion"), "cyrk-vern8", found)


def test_angles_near_their_pole_weigh_more():
    found = pilot(named_scene("near-pole"))
    plain, slowed = (
        load_of(form(name), "taylor", found, 201, 1e-6).rotations
        for name in ("quaternion", "euler-angles")
    )
    assert slowed > 2 * plain


def test_what_holds_explicit_methods_back_does_not_weigh_on_implicit_ones():
    """Between accuracy and stability: the explicit pilot is held back, the implicit one is not."""
    scene = replace(named_scene("paper"), stokes=0.1, time=20.0)
    found = pilot(scene)
    assert 1e3 < found.damping_times < 2e4
    explicit, implicit = (
        load_of(form("quaternion"), solver, found, 201, 1e-6)
        for solver in ("cyrk-dop853", "cyrk-bdf")
    )
    assert 0.1 * found.damping_times < explicit.damping_times < 2 * found.damping_times
    assert 0.3 * found.rotations < implicit.rotations < 3 * found.rotations
    assert explicit.rotations > 10 * found.rotations


def test_questions_are_their_seed_s():
    few, many = questions(TRAINING_SEED, 5), questions(TRAINING_SEED, 50)
    assert many[:5] == few
    assert questions(HELD_OUT_SEED, 5) != few
    for question in many:
        assert 1e-11 <= question.error <= 1e-2
        assert question.scene.time > 0
        assert question.want == "slow" or question.scene.ellipsoid.kind != "sphere"
    kinds = {question.scene.ellipsoid.kind for question in many}
    assert {"triaxial", "prolate", "oblate"} <= kinds


def test_training_measures_what_makes_sense():
    stiff, paper = named_scene("stiff"), named_scene("paper")
    assert "cyrk-vern8" not in solvers_for(stiff, 0)
    assert "cyrk-radau" in solvers_for(stiff, 0)
    assert "averaged" in forms_for(paper, 40.0)
    assert "averaged" not in forms_for(stiff, 3.0)
    cases = [case for batch in training(2) for case in batch]
    names = [f"random-{TRAINING_SEED}-0", f"random-{TRAINING_SEED}-1", f"long-{TRAINING_SEED}-0"]
    assert list(dict.fromkeys(case.scene_name for case in cases)) == names
    assert len({case.key for case in cases}) == len(cases)
    assert {case.solver for case in cases} <= set(SOLVERS)


def test_intervals_overlap_or_do_not():
    assert Interval(2.0, 1.0, 3.0).overlaps(Interval(4.0, 3.0, 5.0))
    assert not Interval(2.0, 1.0, 3.0).overlaps(Interval(4.0, 3.1, 5.0))
    assert Interval(2.0, 1.0, 3.0).plus(Interval(2.0, 1.0, 3.0)) == Interval(4.0, 2.0, 6.0)


@pytest.mark.parametrize(("low", "high"), [(0.5, 2.0), (0.25, 1.5), (0.9, 30.0)])
def test_the_mean_of_an_interval_is_that_of_numbers_drawn_from_it(low, high):
    numbers = ndtri((np.arange(100_000) + 0.5) / 100_000)
    drawn = 3.0 * np.exp(numbers / 1.96 * np.where(numbers < 0, -np.log(low), np.log(high)))
    assert Interval(3.0, 3.0 * low, 3.0 * high).mean == pytest.approx(drawn.mean(), rel=1e-2)


def test_pilot_of_a_spinning_sphere_counts_its_turns():
    """Torque-free: |ω| stays, so that N = |ω|T/2π."""
    scene = Scene(
        Ellipsoid((1.0, 1.0, 1.0)), inf, BodyStart((1.0, 0.0, 0.0, 0.0), (0.0, 3.0, 4.0)), 100.0
    )
    assert pilot(scene).rotations == pytest.approx(500 / (2 * pi), rel=1e-6)
