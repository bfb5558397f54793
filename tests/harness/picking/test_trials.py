"""Trials: tolerances of the first ways follow from errors made on the very scene, not from how wide a law is."""

from dataclasses import replace

import numpy as np
import pytest

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.answers.interval import Interval
from polhode.harness.calibration.scenes import questions
from polhode.harness.picking import ranking, trials
from polhode.harness.picking.candidate import LOOSEST, Candidate
from polhode.harness.picking.laws import Laws, Load, load_laws
from polhode.harness.picking.pilot import form_sensitivity, pilot
from polhode.harness.picking.ranking import NotAttainableError, first_way, pick
from polhode.harness.picking.refusals import one_digit
from polhode.harness.references.errors import errors
from polhode.harness.references.reference import reference
from polhode.models.catalogue import form, reference_form
from polhode.models.scene import BodyStart, Scene
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import Status
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("swift_machine")
WAY = ("form", "solver", "tolerance")
SAID = "a trial run errs by"


def seen(scene, name, solver, tolerance):
    """What a run gives at the output times that `pick` takes it to be asked for."""
    problem = form(name).problem(scene)
    run = solve(problem, solver, tolerance, np.linspace(0, problem.end, DEFAULT_SAMPLES))
    return form(name).observe(scene, run.states)


def made(scene, way, want):
    """The error of a way."""
    true = reference(scene, reference_form(scene), DEFAULT_SAMPLES).observables
    return getattr(
        errors(scene.ellipsoid, seen(scene, way.form, way.solver, way.tolerance), true), want
    )


def wider(laws: Laws, factor: float) -> Laws:
    """The same laws, whose upper ends of errors are so much larger in logarithms."""
    methods = {
        name: replace(
            law,
            errors={
                want: replace(each, stray=replace(each.stray, high=each.stray.high + factor))
                for want, each in law.errors.items()
            },
        )
        for name, law in laws.methods.items()
    }
    return replace(laws, methods=methods)


@pytest.mark.parametrize(
    ("name", "error", "want"),
    [("paper", 1e-6, "slow"), ("paper", 2e-13, "slow"), ("needle", 1e-4, "orientation")],
)
def test_a_trial_knows_the_error(name, error, want):
    """Down to rounding, where no law promises a yardstick."""
    scene = named_scene(name)
    first = pick(scene, error, want).ranking[0]
    assert SAID in first.reason
    true = made(scene, first, want)
    assert first.error.low <= true <= first.error.high <= error
    assert first.error.predicted == pytest.approx(true, rel=0.1)


def test_where_the_full_equations_take_long_averaging_is_tried_against_a_run_in_pieces(monkeypatch):
    """As none of theirs may be a yardstick: at this St averaging itself is exact but for the solver's error."""
    scene, error = replace(named_scene("spheroid"), stokes=1e7, time=1e7), 1e-6
    doubt = Interval(error / 2, error / 2, 50 * error)
    monkeypatch.setattr(ranking, "own_estimate", lambda *_: {"slow": doubt})
    monkeypatch.setattr(ranking, "model_errors", lambda *_: {"slow": doubt})
    first = pick(scene, error, laws=load_laws()).ranking[0]
    assert first.form == "averaged-second-order"
    assert SAID in first.reason
    own, exact = (
        seen(scene, first.form, first.solver, tolerance) for tolerance in (first.tolerance, 1e-14)
    )
    assert first.error.low <= errors(scene.ellipsoid, own, exact).slow <= first.error.high <= error

    def noted(*given):
        rows = [*yardsticks(*given)]
        offered.extend(
            (candidate.form.name, met) for candidate, _, met in rows if given[1].form.averaged
        )
        return iter(rows)

    # Where no law bounds what runs in pieces err by, these and averages may err alike.
    yardsticks, offered = trials.Trials._yardsticks, []
    monkeypatch.setattr(trials.Trials, "_yardsticks", noted)
    pick(scene, error, laws=wider(load_laws(), 20.0))
    assert {met for name, met in offered if name != "hybrid"} == {trials.UNLIKE_MET}
    assert not [met for name, met in offered if name == "hybrid"]


@pytest.mark.parametrize("known", [True, False])
def test_averaging_that_may_err_too_much_is_tried_against_the_full_equations(known, monkeypatch):
    """Unless its error is known to be too large."""
    scene, error = replace(named_scene("spheroid"), stokes=1e5, time=1e4), 1e-5
    doubt = Interval(5 * error, 5 * error if known else error / 2, 50 * error)
    monkeypatch.setattr(ranking, "own_estimate", lambda *_: {"slow": doubt})
    monkeypatch.setattr(ranking, "model_errors", lambda *_: {"slow": doubt})
    rows = pick(scene, error, laws=load_laws()).ranking
    tried = [way for way in rows if form(way.form).averaged]
    assert bool(tried) is not known
    for way in tried:
        assert SAID in way.reason
        assert way.error.low <= made(scene, way, "slow") <= way.error.high <= error


def test_a_yardstick_of_the_same_averaged_form_is_as_good_where_averaging_takes_most_of_the_error(
    monkeypatch,
):
    """What averaging errs by is the same in both."""
    scene, error, seen = replace(named_scene("spheroid"), stokes=1e5, time=1e4), 1e-5, []
    most = Interval(0.4 * error, 0.2 * error, 0.8 * error)
    monkeypatch.setattr(ranking, "own_estimate", lambda *_: {"slow": most})
    monkeypatch.setattr(ranking, "model_errors", lambda *_: {"slow": most})

    def noted(*given):
        seen.append((given[1].form.averaged, found := yardstick(*given)))
        return found

    yardstick = trials.Trials.yardstick
    monkeypatch.setattr(trials.Trials, "yardstick", noted)
    pick(scene, error, laws=load_laws())
    assert [found.met for averaged, found in seen if averaged and found] == [trials.MET]


def test_a_way_over_many_periods_is_held_against_its_own_tighter_run(monkeypatch):
    """Where all others would take long."""
    scene, error, want = replace(named_scene("spheroid"), stokes=1e6, time=2e5), 1e-4, "orientation"
    monkeypatch.setattr(trials, "YARDSTICK", 0.9)
    way = pick(scene, error, want, laws=load_laws()).ranking[0]
    assert way.solver in (many := ("splitting", "stroboscopic"))
    assert SAID in way.reason
    own, exact = (
        seen(scene, *known)
        for known in (
            (way.form, way.solver, way.tolerance),
            (way.form, "splitting-extended", 1e-12),
        )
    )
    assert (
        way.error.low <= errors(scene.ellipsoid, own, exact).orientation <= way.error.high <= error
    )
    monkeypatch.setattr(trials.Trials, "error", lambda *_: 0.0)
    # Of a run made twice nothing follows.
    rows = pick(scene, error, want, laws=load_laws()).ranking
    assert all(SAID not in each.reason for each in rows if each.solver in many)


@pytest.mark.parametrize(("error", "at_word"), [(1e-9, False), (1e-8, True)])
def test_a_run_in_pieces_is_held_against_its_own_tighter_one_or_taken_at_its_word(
    error, at_word, monkeypatch
):
    """Where the full equations would take long."""
    monkeypatch.setattr(trials, "OVERRUN", 1e3)
    if at_word:
        # No tighter run of its own is tight enough.
        monkeypatch.setattr(trials, "STATED", 0.0)
    (*_, asked) = questions(6143, 4, "long")
    scene = asked.scene
    way = pick(scene, error, laws=load_laws()).ranking[0]
    assert way.form == "hybrid"
    assert SAID in way.reason
    assert way.reason.endswith("as its pieces state") == at_word
    own, close = (
        seen(scene, "hybrid", *how)
        for how in ((way.solver, way.tolerance), ("cyrk-dop853", way.tolerance / 100))
    )
    assert way.error.low <= errors(scene.ellipsoid, own, close).slow <= way.error.high <= error


@pytest.mark.parametrize(
    ("seed", "place"),
    [pytest.param(6152, 1, id="hoped-for-misses"), pytest.param(6153, 10, id="surer-ways-first")],
)
def test_rounding_that_laws_foresee_and_runs_do_not_make_costs_nothing(seed, place, monkeypatch):
    """Splitting is ten times as quick as what laws do not refuse."""
    monkeypatch.setattr(trials, "OVERRUN", 1e3)
    asked = questions(seed, place + 1, "long")[place]
    way = pick(asked.scene, asked.error, asked.want, laws=load_laws()).ranking[0]
    assert way.solver == "splitting"
    assert SAID in way.reason
    own, exact = (
        seen(asked.scene, way.form, *how)
        for how in ((way.solver, way.tolerance), ("splitting-extended", 1e-12))
    )
    assert (
        way.error.low
        <= getattr(errors(asked.scene.ellipsoid, own, exact), asked.want)
        <= way.error.high
    )
    assert way.error.high <= asked.error * (1 + 1e-9)


def test_what_laws_refuse_near_double_precision_is_answered_if_two_runs_agree(monkeypatch):
    scene, error = named_scene("paper"), 2e-13
    first = pick(scene, error, "orientation", laws=load_laws()).ranking[0]
    assert first.error.low <= made(scene, first, "orientation") <= first.error.high <= error
    monkeypatch.setattr(trials, "WAYS", 0)
    with pytest.raises(NotAttainableError, match="rounding"):
        pick(scene, error, "orientation", laws=load_laws())


def test_a_run_that_takes_too_long_is_tried_again_more_loosely(monkeypatch):
    """And if none does, what laws promise of tighter ones is no longer believed."""
    scene, laws, asked = replace(named_scene("spheroid"), stokes=1e4, time=3e3), load_laws(), []
    usual, run = pick(scene, 1e-7, laws=laws).ranking[0], trials.Trials.run
    method = usual.form, usual.solver

    def late(self, candidate, tolerance, seconds):
        found = run(self, candidate, tolerance, seconds)
        if (candidate.form.name, candidate.solver) != method:
            return found
        asked.append(tolerance)
        return found._replace(status=Status.TIME_LIMIT, seen=None)

    monkeypatch.setattr(trials.Trials, "run", late)
    rows = pick(scene, 1e-7, laws=laws).ranking
    assert asked[1] == one_digit(trials.LOOSER * asked[0])
    (same,) = (way for way in rows if (way.form, way.solver) == method)
    monkeypatch.setattr(trials, "WAYS", 0)
    (alone,) = (
        way for way in pick(scene, 1e-7, laws=laws).ranking if (way.form, way.solver) == method
    )
    assert same.seconds.predicted == pytest.approx(trials.OVERRUN * alone.seconds.predicted)


def test_caution_of_a_law_does_not_tighten_what_was_tried():
    scene, laws = named_scene("paper"), load_laws()
    usual, cautious = (pick(scene, 1e-6, laws=each).ranking for each in (laws, wider(laws, 3.0)))
    assert (cautious[0].solver, cautious[0].tolerance) == (usual[0].solver, usual[0].tolerance)
    later = {(way.form, way.solver): way.tolerance for way in usual if SAID not in way.reason}
    assert all(
        way.tolerance < later[way.form, way.solver]
        for way in cautious
        if (way.form, way.solver) in later
    )


@pytest.mark.parametrize("nothing", ["WAYS", "ALL", "COMPILED"])
def test_without_trials_or_time_for_them_laws_decide(nothing, monkeypatch):
    scene, laws = named_scene("paper"), load_laws()
    tried = pick(scene, 1e-6, laws=laws).ranking[0]
    monkeypatch.setattr(trials, nothing, 0)
    alone = pick(scene, 1e-6, laws=laws).ranking
    assert all(SAID not in way.reason for way in alone)
    assert tried.seconds.predicted < alone[0].seconds.predicted


def test_laws_decide_where_a_yardstick_would_take_long():
    assert all(SAID not in way.reason for way in pick(named_scene("long"), 1e-3).ranking)


def test_steps_that_a_trial_made_price_a_way_of_many_periods():
    scene, laws = replace(named_scene("spheroid"), stokes=1e4, time=3e3), load_laws()
    way = pick(scene, 1e-7, laws=laws).ranking[0]
    assert SAID in way.reason
    assert way.solver in ("splitting", "stroboscopic")
    problem = form(way.form).problem(scene)
    work = solve(
        problem, way.solver, way.tolerance, np.linspace(0, problem.end, DEFAULT_SAMPLES)
    ).work
    load = Load((work.steps or 0) + (work.rejected or 0), work.inner or 0, 0.0, DEFAULT_SAMPLES)
    assert way.seconds == laws.methods[way.form, way.solver].cost.predict(load, way.tolerance)


def test_a_trial_without_any_error_asks_for_the_loosest_tolerance_whatever_the_order(monkeypatch):
    laws = load_laws()
    low = {
        name: replace(
            law, errors={want: replace(each, order=0.6) for want, each in law.errors.items()}
        )
        for name, law in laws.methods.items()
    }
    monkeypatch.setattr(trials.Trials, "error", lambda *_: 0.0)
    first = pick(named_scene("paper"), 1e-6, laws=replace(laws, methods=low)).ranking[0]
    assert f"{SAID} 0.0e0" in first.reason
    assert first.tolerance == LOOSEST


@pytest.mark.parametrize(("error", "count"), [(1e-2, trials.WAYS), (np.inf, 0)])
def test_an_error_shown_to_be_missed_excludes_a_way_and_a_run_that_fails_does_not(
    error, count, monkeypatch
):
    """Whatever the law promises."""
    hoped = {"tolerance": 1e-12, "seconds": Interval(1e-9, 1e-9, 1e-9)}
    monkeypatch.setattr(Candidate, "hoped", lambda self, **_: replace(self.expected(), **hoped))
    monkeypatch.setattr(trials, "ALL", np.inf)
    monkeypatch.setattr(trials, "OVERRUN", np.inf)
    monkeypatch.setattr(trials.Trials, "error", lambda *_: error)
    monkeypatch.setattr(trials, "TOLERANCES", 1)
    excluded = pick(named_scene("needle"), 1e-4, "orientation", laws=load_laws()).excluded
    assert [each.reason for each in excluded].count(
        "a trial run at 1.0e-12 errs by 1.0e-2"
    ) == count


def test_a_law_that_a_trial_contradicts_is_believed_no_longer(monkeypatch):
    """Nor those of other solvers on the same equations: what amplifies errors is the scene's."""
    scene, error, laws = named_scene("paper"), 1e-7, load_laws()
    methods = {
        name: replace(
            law,
            errors={
                want: replace(each, offset=each.offset - 2.5) for want, each in law.errors.items()
            },
        )
        for name, law in laws.methods.items()
    }
    # No trial but the first one: what follows from it has to do.
    monkeypatch.setattr(trials, "TOLERANCES", 1)
    for way in pick(scene, error, laws=replace(laws, methods=methods)).ranking[:3]:
        assert made(scene, way, "slow") <= error


def test_what_a_form_in_pieces_missed_it_misses_by_every_solver():
    """At a tolerance, by any solver that its law promised more of; one that promised no more is as good as before."""
    scene = replace(named_scene("spheroid"), stokes=1e6, time=1e5)
    each, found, laws = form("hybrid"), pilot(scene), load_laws()
    at = form_sensitivity(each, found)["slow"]
    known = {name: laws.methods["hybrid", name] for name in ("cyrk-dop853", "cyrk-vern8", "taylor")}
    dop853, vern8, taylor = (
        Candidate(each, name, law, law.errors["long slow"], at, 1e-6, None, found, DEFAULT_SAMPLES)
        for name, law in known.items()
    )
    least = 3 * dop853.law.predict(at, 1e-7).high
    run = trials.Trials([dop853, vern8, taylor], "slow", 1.0, 1.0, misses=[(dop853, 1e-7, least)])
    held = taylor.worse(least / taylor.law.predict(at, 1e-7).high)
    for other in (vern8, taylor, held):
        worse = other.worse(run.excess(other))
        assert worse.law.predict(at, 1e-7).high == pytest.approx(least / trials.AIM, rel=1e-3)
    assert run.excess(held.worse(1 / trials.AIM)) == pytest.approx(1.0, rel=1e-3)


def test_runs_that_average_are_foreseen_for_no_solver_that_never_averaged_in_training():
    scene, laws = replace(named_scene("spheroid"), stokes=1e6, time=1e5), load_laws()
    unknown = {
        name
        for (each, name), law in laws.methods.items()
        if each == "hybrid" and not law.cost.per_piece
    }
    assert unknown
    found = pick(scene, 1e-4, laws=laws)
    reasons = {each.solver: each.reason for each in found.excluded if each.form == "hybrid"}
    assert {reasons.get(name) for name in unknown} == {
        "no law: not measured with pieces that average"
    }
    assert {"cyrk-dop853", "taylor"} <= {
        way.solver for way in found.ranking if way.form == "hybrid"
    }


@pytest.mark.parametrize(
    ("semi_axes", "stokes", "time", "error"),
    [((1.0, 1.0, 0.1), 8e-4, 60.0, 1e-6), ((1.0, 0.04, 0.07), 3e-4, 130.0, 1e-4)],
)
def test_stiff_runs_are_tried_in_angles_too(semi_axes, stokes, time, error):
    """Where they come first by laws, which a stiff scene may exceed by far."""
    start = BodyStart((0.2, 0.1, -0.7, 0.7), (-0.5, 1.0, 0.75))
    scene = Scene(Ellipsoid(semi_axes), stokes, start, time)
    first = pick(scene, error).ranking[0]
    chosen = first_way(scene, error, "slow", DEFAULT_SAMPLES)
    assert chosen
    assert (chosen.form, chosen.solver, chosen.tolerance) == (
        first.form,
        first.solver,
        first.tolerance,
    )
    true = seen(scene, "quaternion", "cyrk-radau", 1e-12)
    assert (
        errors(scene.ellipsoid, seen(scene, first.form, first.solver, first.tolerance), true).slow
        <= error
    )
