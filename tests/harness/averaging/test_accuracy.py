"""Averaging over random bodies: bodies that stay the same, errors against other ways, laws of planted errors."""

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import inf, isnan, nan
from pathlib import Path
from time import sleep

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from commandline import runner

from polhode.harness.answers import averaging_laws
from polhode.harness.answers.confirmed import confirmation
from polhode.harness.answers.rules import Method
from polhode.harness.answers.runs import Runner
from polhode.harness.api import plan
from polhode.harness.averaging import laws as laws_module, random_study, restated, shares
from polhode.harness.averaging.bodies import KINDS, STRONG_KICK, Body, drawn
from polhode.harness.averaging.laws import laws_of
from polhode.harness.averaging.random_study import (
    STUDIED_SLOW_TIMES,
    TIMES,
    Data,
    Task,
    _groups,
    first_references,
    measure,
    measure_together,
    read_data,
    reference_of,
    run,
    tables_of,
    tasks,
    write_data,
)
from polhode.harness.averaging.shares import ORDER_ONE, ORDER_TWO, Quantile, at, bounded, cancelled
from polhode.harness.cli import polhode
from polhode.harness.common.machine import makers_of
from polhode.harness.common.store import Store
from polhode.harness.pages.averaging.random_bodies import (
    _panels,
    _refusals,
    as_text,
    page,
    write_page,
)
from polhode.harness.references.errors import errors
from polhode.harness.references.extended import ReferenceFailedError, reference_runs
from polhode.models.catalogue import form as find_form
from polhode.models.scene import EulerStart, Scene
from polhode.models.second_order.outline import outline
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.solve import solve

TIMED = {"errors": {"date": "2026-05-04T03:02:01Z", "versions": {"polhode": "0.1.0"}}}
MACHINE = {"processor": "abacus", "cores": 1, "system": "wood", "python": "3.11.7"}
STOKES = (1e3, 1e4, 1e5, 1e6)


def planted(
    error: Callable[[str, int, float], float],
    kinds: tuple[str, ...] = ("prolate", "crosses"),
    bodies: int = 40,
    bound: float = 2.0,
) -> Data:
    """A study whose first-order errors are given, as functions of kind, body and St; second order squares them."""
    records = []
    for kind in kinds:
        crossing = 0.01 if kind == "crosses" else nan
        for number in range(bodies):
            body = Body(kind, number, (1, 1, 2), (1, 0, 0, 0), (0, 0, 1), crossing, nan)
            records += [
                record(body, stokes, error(kind, number, stokes), bound) for stokes in STOKES
            ]
    return tables_of(records, TIMED)


def record(body: Body, stokes: float, error: float, bound: float) -> dict:
    head = {"kind": body.kind, "body": body.body, "stokes": stokes}

    def columns(name: str, value: float) -> dict[str, float]:
        return {f"{name}_{slow_time:g}": value for slow_time in STUDIED_SLOW_TIMES}

    reference = {**head, "method": "long double", "failure": "", "seconds": 1.0}
    reference |= columns("slow", 1e-22) | columns("turned", 1e-22)
    rows = []
    for form, value, turned in (
        ("averaged", error, nan),
        ("averaged-second-order", error**2, error),
    ):
        row = {**head, "form": form, "requested": nan, "solver_error": 1e-9, "seconds": 1e-3}
        row |= columns("slow", value) | columns("turned", turned) | columns("bound", bound * value)
        rows.append(row | columns("turned_bound", nan) | {"refused": ""})
    cost = {
        **head,
        "solver": "cyrk-vern8",
        "tolerance": 1e-9,
        "error": 1e-9,
        "seconds": stokes / 1e6,
    }
    return {"body": vars(body), "reference": reference, "errors": rows, "costs": [cost]}


def test_a_body_is_the_same_for_ever():
    body = drawn("prolate", 0)
    assert body.semi_axes == (1.0, 0.296494, 0.296494)
    assert body.quaternion == (-0.214124, 0.55233, -0.370056, 0.71564)
    assert body.spin == (-0.232799, -0.0668346, -0.459617)
    assert drawn("settled", 2).spin == (-0.00184526, 0.00174112, -0.501943)
    assert drawn("crosses", 1).crossing == 0.0675


@pytest.mark.parametrize("kind", KINDS)
def test_bodies_belong_to_their_kind(kind: str):
    # Tables that tell kicks take a second for each body that is drawn, until one belongs to the kind.
    for number in range(1 if kind == "resonance" else 3):
        body = drawn(kind, number)
        scene = body.scene(1e5)
        axes = np.sort(body.semi_axes)
        assert axes[-1] == 1
        assert axes[0] >= 0.149
        shape = scene.ellipsoid.kind
        if kind in ("prolate", "oblate"):
            assert shape == kind
        if kind in ("stays", "resonance", "crosses"):
            assert shape == "triaxial"
            assert body.crosses == (kind == "crosses")
        if kind == "near-spheroidal":
            assert shape == "triaxial"
            assert min(1 - axes[:-1] / axes[1:]) < 0.051
        if kind in ("stays", "resonance"):
            largest = max((kick.size for kick in outline(scene).kicks), default=0.0)
            assert (largest * 1e5**0.5 >= 0.9 * STRONG_KICK) == (kind == "resonance")
        if kind == "rest":
            assert body.spin == (0, 0, 0)
        if kind == "settled":
            spin = scene.initial.angular_momentum[0] / max(scene.ellipsoid.inertia)
            assert np.abs(spin - [0, 0, -0.5]).max() < 0.3


def test_tasks_are_cheap_first_and_hold_every_body():
    todo = tasks({100.0: 3, 1e6: 2})
    assert len(todo) == len(set(todo)) == len(KINDS) * 5
    assert todo[0].stokes == 100
    # Those whose reference fails have others in their place.
    more = set(random_study.whole()) - set(tasks(random_study.BODIES))
    assert more == {Task("crosses", 200, 1e6), Task("crosses", 60, 1e7)}
    assert todo[-1].body == 1
    assert todo[-1].stokes == 1e6
    assert len({task.key for task in todo}) == len(todo)


@pytest.mark.parametrize("kind", ["oblate", "crosses"])
def test_two_unlike_methods_know_what_long_double_knows(kind: str):
    scene = drawn(kind, 1).scene(3160.0)
    found = reference_of(scene)
    form = find_form("spheroid-axis" if kind == "oblate" else "quaternion")
    runs = (("long double", 1e-18), ("long double", 1e-17))
    states, _ = reference_runs(form.problem(scene), TIMES * scene.stokes, runs)
    exact = form.observe(scene, states)
    apart = errors(scene.ellipsoid, found.observables, exact)
    assert apart.slow <= found.slow[-1] < 1e-10
    assert apart.orientation is not None
    assert apart.orientation <= found.turned[-1] < 1e-7
    assert found.slow == sorted(found.slow)


def test_a_reference_that_nothing_confirms_is_refused(monkeypatch: pytest.MonkeyPatch):
    unlike = {"quaternion": ("cyrk-vern8", 1e-2)}
    monkeypatch.setattr(random_study, "_UNLIKE", unlike)
    with pytest.raises(ReferenceFailedError, match="runs are"):
        reference_of(drawn("crosses", 1).scene(3160.0))
    found = measure(Task("crosses", 1, 3160.0))
    assert "apart" in found["reference"]["failure"]
    assert found["errors"] == []


def test_errors_are_those_of_runs_made_by_hand():
    task = Task("crosses", 1, 1000.0)
    scene = drawn(*task[:2]).scene(task.stokes)
    first, second, *rest = measure(task)["errors"]
    assert rest == []
    slow_times = np.linspace(0, 1, 2001)
    runs = []
    for name, solver, tolerance in (("averaged", "dop853", 1e-11), ("quaternion", "dop853", 1e-12)):
        form = find_form(name)
        problem = form.problem(scene)
        states = solve(problem, solver, tolerance, slow_times * problem.end).states
        runs.append(form.observe(scene, states))
    for slow_time in STUDIED_SLOW_TIMES:
        last = round(2000 * slow_time) + 1
        by_hand = errors(scene.ellipsoid, runs[0][:last], runs[1][:last]).slow
        assert first[f"slow_{slow_time:g}"] == pytest.approx(by_hand, rel=0.1)
    assert all(isnan(first[f"turned_{slow_time:g}"]) for slow_time in STUDIED_SLOW_TIMES)
    # The run meets L² = 2EI₂ soon, so that second order does not follow it far.
    assert isnan(second["slow_1"])
    assert second["refused"]
    # Across L² = 2EI₂ the tolerance is not kept.
    assert 1e-6 < first["solver_error"] < 1e-2 * first["slow_1"]
    assert first["bound_1"] >= first["slow_1"]


def test_hybrid_and_costs_are_measured_where_they_are_to_be(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(random_study, "REQUESTED_ERRORS", (1e-6,))
    found = measure(Task("oblate", 1, 1e4))
    first, second, hybrid = found["errors"]
    assert second["slow_1"] < 0.1 * first["slow_1"]
    assert second["turned_1"] <= second["turned_bound_1"]
    assert hybrid["slow_1"] <= 1e-6
    assert hybrid["slow_0.05"] <= hybrid["bound_0.05"] <= hybrid["bound_1"]
    solvers = {row["solver"] for row in found["costs"]}
    assert solvers == {"cyrk-vern8", "splitting"}
    assert min(row["error"] for row in found["costs"]) <= 1e-8
    assert all(row["seconds"] > 0 for row in found["costs"])


def test_a_start_at_rest_is_refused_by_both_orders():
    first, second = measure(Task("rest", 0, 100.0))["errors"]
    assert "L = 0" in first["refused"]
    assert "L = 0" in second["refused"]


@pytest.mark.parametrize(
    ("target", "stokes", "source"),
    [
        (1.0, 1e2, "at most"),
        (1e-2, 3e3, "measured"),
        (1e-4, 3e5, "measured"),
        (1e-6, 3e7, "extrapolated"),
        (1e-8, nan, "beyond"),
    ],
)
def test_the_stokes_number_that_an_error_needs(target: float, stokes: float, source: str):
    places = (1e2, 1e3, 1e4, 1e5, 1e6)
    errors = tuple(30 / place for place in places)
    low = tuple(error / 3 for error in errors)
    # At the largest St there are too few bodies for an upper end.
    high = (*(3 * error for error in errors[:-1]), nan)
    needed = Quantile(0.5, places, errors, (200,) * 5, low, high).needed(target, -1.0)
    assert needed[:2] == (pytest.approx(stokes, nan_ok=True), source)
    if source == "measured":
        assert needed.low == pytest.approx(stokes / 3)
        assert needed.high == pytest.approx(3 * stokes if stokes < 1e5 else nan, nan_ok=True)
    assert (
        Quantile(0.5, places, errors, (200,) * 5, low, high).needed(1e-6, None).source == "beyond"
    )


def test_an_error_that_rises_again_is_not_met_before_and_refusals_count():
    places, counts = (1e2, 1e3, 1e4, 1e5), (20,) * 4

    def needed(errors: tuple[float, ...], target: float) -> tuple[float, str]:
        answer = Quantile(0.5, places, errors, counts, errors, errors).needed(target, -1.0)
        assert (answer.low, answer.high) == pytest.approx((answer.stokes,) * 2, nan_ok=True)
        return answer.stokes, answer.source

    assert needed((1e-3, 1e-5, 1e-2, 1e-4), 1e-3) == (pytest.approx(10**4.5), "measured")
    assert needed((inf, inf, 1e-2, 1e-4), 0.1) == (1e4, "measured")
    assert isnan(needed((inf,) * 4, 0.1)[0])


def test_a_share_is_that_of_the_bodies():
    data = planted(lambda kind, body, stokes: (1 + body) / stokes)
    runs = at(data, 1.0)
    own = runs[(runs["kind"] == "prolate") & (runs["order"] == ORDER_ONE)]
    half, most = (shares.quantile(own, share) for share in shares.SHARES)
    assert half is not None
    assert most is not None
    assert half.error[0] == 20 / 1e3
    assert most.error[0] == 39 / 1e3
    assert half.bodies == (40,) * 4
    # Of 40 ordered values the 14th and the 27th bracket the median at 95 %; none is large enough to bracket 97.5 %.
    assert (half.low[0], half.high[0]) == (14 / 1e3, 27 / 1e3)
    assert most.low[0] == 37 / 1e3
    assert isnan(most.high[0])
    few = own[own["body"] < shares.LEAST_BODIES - 1]
    assert shares.quantile(few, 0.5) is None


def test_crossings_and_resonances_are_extrapolated_by_the_slower_law():
    kinds = ("prolate", "resonance", "crosses")
    runs = at(planted(lambda kind, body, stokes: 9 / stokes, kinds), 1.0)
    for kind, expected in (("prolate", 9e6), ("resonance", 8.1e7), ("crosses", 8.1e7)):
        stokes, source, *_ = shares.needed(runs, kind, ORDER_ONE, 0.5, 1e-6)
        assert (stokes, source) == (pytest.approx(expected), "extrapolated")
    assert shares.needed(runs, "resonance", ORDER_ONE, 0.5, 5e-7)[1] == "beyond"
    assert shares.needed(runs, "resonance", ORDER_TWO, 0.5, 1e-11)[0] == pytest.approx(8.1**2 * 1e6)


def test_planted_exponents_are_found_by_bodies():
    def error(kind: str, body: int, stokes: float) -> float:
        power = 0.5 if kind == "crosses" else 1.0
        noise = 10 ** (0.02 * np.sin(17 * body + np.log(stokes)))
        return (1 + body) / 1000 / stokes**power * noise

    rows = shares.exponents(at(planted(error), 1.0), STOKES)
    assert len(rows) == 2 * 3 * 3
    for row in rows:
        expected = -0.5 if row.kind == "crosses" else -1.0
        expected *= 2 if row.order == ORDER_TWO and row.error == "slow" else 1
        assert row.low <= expected <= row.high
        assert row.width < 0.05
        assert row.bodies == 40
    first = [row for row in rows if row.order == ORDER_ONE]
    assert all(row.agrees for row in first)
    # After a crossing any exponent between the two laws agrees.
    crossing, other = (next(row for row in first if row.crosses is flag) for flag in (True, False))
    assert replace(crossing, low=-0.9, high=-0.8).agrees
    assert not replace(crossing, low=-0.4, high=-0.3).agrees
    assert not replace(other, low=-0.9, high=-0.8).agrees


def test_statements_that_do_not_hold_are_counted():
    data = planted(lambda kind, body, stokes: (1 + body) / stokes, bound=2.0)
    data.errors.loc[data.errors["body"] < 3, "bound_1"] *= 0.25
    rows = bounded(at(data, 1.0))
    first = next(row for row in rows if (row.kind, row.order) == ("prolate", ORDER_ONE))
    assert (first.runs, first.missed, first.bodies, first.held) == (120, 9, 40, 37)
    assert first.worst == pytest.approx(2.0)
    assert first.over == pytest.approx(2.0)
    assert not first.enough
    # A run that misses up to one slow time of several is missed once.
    whole = next(
        row
        for row in bounded(shares.all_times(data))
        if (row.kind, row.order) == ("prolate", ORDER_ONE)
    )
    assert (whole.runs, whole.missed) == (120, 9)
    low, high = first.interval
    assert low < 37 / 40 < high


def test_an_error_small_by_cancellation_is_named():
    def error(kind: str, body: int, stokes: float) -> float:
        small = kind == "prolate" and body == 7 and stokes == 1e4
        return (0.1 if small else 1.0) / stokes

    rows, count = cancelled(at(planted(error), 1.0))
    assert count == 2 * 2 * 40 * 2
    first = next(row for row in rows if row.order == ORDER_ONE)
    assert (first.kind, first.body, first.stokes) == ("prolate", 7, (1e3, 1e4, 1e5))
    assert first.ratio == pytest.approx(0.1)
    assert {row.body for row in rows} == {7}


def test_laws_are_theory_where_the_data_allow_it_and_slower_where_not():
    found = laws_of(planted(lambda kind, body, stokes: (1 + body) / 100 / stokes**0.5))
    assert found["exponents"] == {
        ORDER_ONE: -0.5,
        f"{ORDER_ONE}, crossing": -0.5,
        ORDER_TWO: -1.0,
    }
    data = planted(lambda kind, body, stokes: (1 + body) / stokes)
    found = laws_of(data)
    assert found["exponents"] == {
        ORDER_ONE: -1.0,
        f"{ORDER_ONE}, crossing": -0.5,
        ORDER_TWO: -2.0,
    }
    assert found["measured"][ORDER_ONE]["bodies"] == 40
    assert found["most"][ORDER_ONE] == pytest.approx(39, rel=0.05)
    assert found["few"][ORDER_ONE] == pytest.approx(2, rel=0.3)
    assert found["from"][ORDER_ONE]["prolate"]["0.001"] == [2e4, 3.9e4, 3.7e4, None]
    assert found["from"][ORDER_ONE]["prolate"]["1e-08"] == [None] * 4
    assert found["from"][averaging_laws.TURNED]["prolate"]["0.001"] == [2e4, 3.9e4, 3.7e4, None]


def test_laws_are_read_by_name():
    assert averaging_laws.power(ORDER_ONE) == 1.0
    assert averaging_laws.power(ORDER_ONE, crosses=True) == 0.5
    most, few = (
        averaging_laws.most_error(ORDER_ONE, 1e5),
        averaging_laws.few_error(ORDER_ONE, 1e5),
    )
    assert few < most
    assert averaging_laws.most_error(ORDER_ONE, 1e6) == pytest.approx(most / 10)
    assert 1.9 < averaging_laws.power(ORDER_TWO) <= 2
    ratio = averaging_laws.few_error(ORDER_TWO, 1e5) / averaging_laws.few_error(ORDER_TWO, 1e6)
    assert ratio == pytest.approx(10 ** averaging_laws.power(ORDER_TWO))


def test_data_come_back_and_the_page_follows_from_them(tmp_path: Path):
    data = planted(lambda kind, body, stokes: (1 + body) / stokes)
    write_page(data, tmp_path, "polhode accuracy")
    back = read_data(tmp_path)
    assert back.done == data.done
    assert back.timed == TIMED
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert page(back, "polhode accuracy") == text
    # Half of the prolate bodies err by 20/St at most, 97.5 % by 39/St.
    row = next(line for line in text.splitlines() if line.startswith("| prolate "))
    assert "| 2000 / 3900 |" in row
    assert "2000 / 3900" in as_text(back)
    assert json.loads((tmp_path / "laws.json").read_text(encoding="utf-8")) == laws_of(back)
    assert (tmp_path / "errors.png").stat().st_size > 10_000
    assert "Measured on 2026-05-04" in text


def test_a_kind_that_is_refused_has_no_bands_and_spoils_no_other():
    data = planted(lambda kind, body, stokes: (1 + body) / stokes, ("prolate", "rest"))
    rest = data.errors["kind"] == "rest"
    names = [f"{name}_{time:g}" for name in ("slow", "turned") for time in STUDIED_SLOW_TIMES]
    data.errors.loc[rest, names] = nan
    data.errors.loc[rest, "refused"] = "the start has L = 0"
    assert _refusals(data) == {"rest": "all refused: the start has L = 0"}
    panels = _panels(data)
    assert [*panels] == ["prolate", "rest", "orientation (rad)"]
    assert panels["rest"] == []
    assert [band.order for band in panels["prolate"]] == [ORDER_ONE, ORDER_TWO]
    (turned,) = panels["orientation (rad)"]
    assert turned.high == pytest.approx([39 / stokes for stokes in STOKES])


def test_a_study_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    measured = []

    def made(task: Task, *_run: object) -> dict:
        measured.append(task)
        return record(drawn(task.kind, task.body), task.stokes, 1 / task.stokes, 2.0)

    monkeypatch.setattr(random_study, "measure", made)
    todo = tasks({100.0: 2}, ("prolate", "oblate"))
    with Store(tmp_path / "store.sqlite") as store:
        assert run(store, todo, seconds=-1.0, quiet=True).references.empty
        first = run(store, todo[:1], quiet=True)
        second = run(store, todo, quiet=True)
    assert measured == todo
    assert first.done == {todo[0]}
    assert second.done == set(todo)
    write_data(second, tmp_path)
    # The tables alone are enough to go on from.
    more = tasks({100.0: 3}, ("prolate", "oblate"))
    with Store(tmp_path / "another.sqlite") as store:
        third = run(store, more, read_data(tmp_path), quiet=True)
    assert third.done == set(more)
    assert len(measured) == len(more)
    assert len(third.errors) == 2 * len(more)
    assert len(third.bodies) == 6


def test_tables_name_every_commit_that_measured_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(
        random_study,
        "measure",
        lambda task, *_run: record(drawn(task.kind, task.body), task.stokes, 1 / task.stokes, 2.0),
    )
    todo = tasks({100.0: 2}, ("prolate", "oblate"))
    with Store(tmp_path / "store.sqlite") as store:
        for commit, until in (("a" * 9, 1), ("b" * 9, 3), ("c" * 9, 3)):
            place = {"machine": MACHINE, "versions": {"polhode": "1"}, "commit": commit}
            monkeypatch.setattr(random_study, "surroundings", lambda place=place: place)
            data = run(store, todo[:until], quiet=True)
    write_data(data, tmp_path)
    for found in (data, tables_of([], read_data(tmp_path).timed, data)):
        assert [entry["commit"] for entry in found.timed.values()] == ["a" * 9, "b" * 9]
    assert [maker.commit for maker in makers_of(page(data, "polhode accuracy"))] == [
        "a" * 9,
        "b" * 9,
    ]


def test_the_first_references_of_the_study_are_known(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(random_study, "BODIES", {100.0: 2})
    monkeypatch.setattr(random_study, "REPLACED", {})
    every = tasks({100.0: 2})
    data = planted(lambda kind, body, stokes: 1 / stokes)
    for some, count in ((every[:5], 5), (every[1:5], None), (every, None)):
        rows = pd.DataFrame(some, columns=["kind", "body", "stokes"])
        assert first_references(data._replace(references=rows)) == count


def test_bodies_in_one_batch_have_the_references_that_each_has_alone():
    # A body of rest that is a spheroid has other equations, and runs alone.
    several = [Task("stays", 45, 1e4), Task("resonance", 45, 1e4), Task("rest", 8, 1e4)]
    together = measure_together(several)
    for task, record in zip(several, together, strict=True):
        alone = measure(task)
        assert record["reference"]["method"] == alone["reference"]["method"]
        # The two runs of a reference agree as closely.
        apart = record["reference"]["slow_1"]
        assert apart == pytest.approx(alone["reference"]["slow_1"], rel=0.5)
        for one, other in zip(record["errors"], alone["errors"], strict=True):
            assert one["slow_1"] == pytest.approx(other["slow_1"], abs=2 * apart, nan_ok=True)


def test_a_batch_has_bodies_of_one_stokes_number():
    long_double = [Task("stays", 1, 1000.0)]
    spheroids = [Task("prolate", 1, 1e4)]
    batched = [Task(kind, body, 1e4) for body in range(4) for kind in ("stays", "crosses", "rest")]
    others = [Task("stays", body, 1e5) for body in range(3)]
    groups = list(_groups([*long_double, *spheroids, *batched[:5], *others, *batched[5:]]))
    assert groups == [long_double, spheroids, batched[:8], others, batched[8:]] or groups == [
        long_double,
        spheroids,
        batched[:8],
        batched[8:],
        others,
    ]


def test_processes_measure_what_one_does(tmp_path: Path):
    todo = [Task("oblate", 45, 10.0), Task("prolate", 45, 10.0)]
    with Store(tmp_path / "store.sqlite") as store:
        apart = run(store, todo, workers=2, quiet=True)
    with Store(tmp_path / "one.sqlite") as store:
        alone = run(store, todo, quiet=True)
    names = ["kind", "body", "form", "slow_1", "turned_1", "refused"]
    assert apart.errors[names].equals(alone.errors[names])


def test_no_process_begins_a_task_after_the_deadline(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Threads stand in for the processes, which would not see a planted `measure`."""
    begun = []

    class Threads(ThreadPoolExecutor):
        def __init__(self, workers: int, mp_context: object) -> None:
            super().__init__(workers)

    def slow(task: Task, *_run: object) -> dict:
        begun.append(task)
        sleep(0.5)
        return record(drawn(task.kind, task.body), task.stokes, 1 / task.stokes, 2.0)

    monkeypatch.setattr(random_study, "measure", slow)
    monkeypatch.setattr(random_study, "ProcessPoolExecutor", Threads)
    todo = tasks({100.0: 3}, ("prolate", "oblate"))
    with Store(tmp_path / "store.sqlite") as store:
        assert run(store, todo, workers=2, seconds=-1.0, quiet=True).references.empty
        data = run(store, todo, workers=2, seconds=0.3, quiet=True)
        assert begun == todo[:2]
        assert data.done == set(begun)
        assert run(store, todo, workers=2, quiet=True).done == set(todo)


def test_the_command_measures_writes_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(random_study, "QUICK_BODIES", {10.0: 1})
    # A spheroid, a body across L² = 2EI₂, and one that averaging refuses: no long tables.
    kinds = ("oblate", "crosses", "rest")
    monkeypatch.setattr(random_study, "tasks", lambda bodies: tasks(bodies, kinds))
    monkeypatch.chdir(tmp_path)
    options = ["accuracy", "--quick", "--quiet", "--workers", "0"]
    outcome = runner().invoke(polhode, [*options, "--json"])
    assert outcome.exit_code == 0, outcome.output
    assert len(json.loads(outcome.stdout)["references"]) == len(kinds)
    assert "reports/accuracy-quick/README.md" in outcome.stderr
    written = tmp_path / "reports" / "accuracy-quick" / "README.md"
    before = written.read_text(encoding="utf-8")
    monkeypatch.setattr(random_study, "measure", None)
    outcome = runner().invoke(polhode, [*options, "--resume"])
    assert outcome.exit_code == 0, outcome.output
    folder = ["--out", str(written.parent)]
    outcome = runner().invoke(polhode, ["accuracy", "--page-only", *folder])
    assert outcome.exit_code == 0, outcome.output
    after = written.read_text(encoding="utf-8")
    assert (
        after.replace("Made by `polhode accuracy`", "Made by `polhode accuracy --quick`") == before
    )


def test_statements_are_made_anew_and_errors_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    measured = tables_of([measure(Task("oblate", 10, 1e4))], TIMED)
    bounds = [name for name in measured.errors if "bound" in name]
    assert measured.errors[bounds].notna().any(axis="columns").all()
    # Tables are written in few digits.
    write_data(measured, tmp_path)
    expected = read_data(tmp_path).errors
    lost = measured.errors.copy()
    lost[bounds] = nan
    write_data(measured._replace(errors=lost), tmp_path)
    options = ["accuracy", "--restate", "--quiet", "--workers", "0", "--out", str(tmp_path)]

    def fail(*_: object) -> None:
        raise ZeroDivisionError("planted")

    with monkeypatch.context() as patched:
        patched.setattr(restated, "stated_of", fail)
        outcome = runner().invoke(polhode, options)
    assert outcome.exit_code == 1
    assert "oblate 10 at St = 10000: ZeroDivisionError: planted; --resume goes on" in outcome.stderr
    outcome = runner().invoke(polhode, [*options, "--resume"])
    assert outcome.exit_code == 0, outcome.output
    pd.testing.assert_frame_equal(read_data(tmp_path).errors, expected)


def test_the_command_refuses_what_it_cannot_do(tmp_path: Path):
    def told(*options: str) -> tuple[int, str]:
        outcome = CliRunner().invoke(polhode, ["accuracy", "--out", str(tmp_path / "a"), *options])
        return outcome.exit_code, outcome.output

    code, text = told("--page-only")
    assert code == 2
    assert "bodies.csv: No such file or directory, expected a table of the study" in text
    assert not (tmp_path / "a").exists()
    code, text = told("--order", "2", "--resume")
    assert code == 2
    assert "--resume: got it with --order 2, expected --order all" in text
    for option in ("--seconds", "--workers"):
        code, text = told("--order", "2", option, "0")
        assert code == 2
        assert f"{option}: got it with --order 2, expected --order all" in text
    for option in ("--seconds", "--references"):
        code, text = told("--restate", option, "1")
        assert code == 2
        assert f"{option}: got it with --restate, which makes no references" in text
    code, text = told("--seconds", "0", "--workers", "0", "--quick", "--quiet")
    assert code == 1
    assert "no body was finished, expected more time" in text


@pytest.mark.parametrize(
    ("stokes", "error"), [(1e6, 4.2392e-5), (1e7, 1.0462e-5), (1e8, 3.9136e-6)]
)
def test_what_averaging_states_holds_beside_the_papers_start_at_large_st(
    stokes: float, error: float
):
    """The errors of first order are those against full runs by Taylor's method at 1e-13, which take minutes."""
    start = EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, -1.0))
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), stokes, start, 0.3 * stokes)
    averaged = plan(scene, "averaged", "cyrk-vern8", 1e-9, 1e-6, "slow", 101).run()
    assert averaged.error.slow is not None
    assert error <= averaged.error.slow.high < 30 * error


def test_what_averaging_states_holds_beside_the_papers_start():
    """A start of the paper's body on which errors were once stated 175 times too small."""
    scene = Scene(
        Ellipsoid((1.0, 0.8, 0.5)),
        1e5,
        EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, -1.0)),
        0.3e5,
    )
    averaged = plan(scene, "averaged", "cyrk-vern8", 1e-9, 1e-6, "slow", 101).run()
    full = plan(scene, "quaternion", "cyrk-vern8", 1e-12, 1e-6, "slow", 101).run()
    error = errors(scene.ellipsoid, averaged.observables, full.observables).slow
    assert averaged.error.slow is not None
    assert error <= averaged.error.slow.high < 30 * error


def test_first_order_states_the_kick_of_a_resonance():
    """This body errs by 9.7e-5 at St = 1e6, up to t₂ = 0.2, which is the kick; without it 4.1e-5 were stated."""
    scene = drawn("resonance", 7).scene(1e6, 0.2)
    kick = max(kick.size for kick in outline(scene).kicks)
    runner = Runner(scene, np.array([0.0, scene.time]))
    method = Method(find_form("averaged"), find_solver("cyrk-vern8"))
    stated = confirmation(runner, runner.run(method, 1e-9))
    assert stated.slow is not None
    assert 9.7e-5 < 2 * kick < stated.slow.high < 1e-3
    # A body without strong resonances states what first order itself errs by.
    calm = drawn("stays", 0).scene(1e6, 0.2)
    runner = Runner(calm, np.array([0.0, calm.time]))
    stated = confirmation(runner, runner.run(method, 1e-9))
    assert stated.slow is not None
    assert 4.8e-5 < stated.slow.high < 4 * 4.8e-5


def test_a_decade_in_which_few_errors_are_known_sets_no_exponent():
    """At St = 1e6 the reference knows but the largest errors, of bodies that err like 1/√St."""
    rows = []
    for body in range(100):
        slow = body < 25
        for stokes in (1e4, 1e5, 1e6):
            error = 1e-4 * (1e4 / stokes) ** (0.5 if slow else 2.0)
            row = {"kind": "stays", "body": body, "stokes": stokes, "slow": error}
            rows.append(row | {"uncertainty": 1e-8 if stokes == 1e6 else 1e-12})
    exponent = laws_module._measured(pd.DataFrame(rows))
    assert exponent is not None
    assert (exponent["begin"], exponent["end"], exponent["bodies"]) == (1e4, 1e5, 100)
    assert exponent["median"] == -2.0
