"""Work-precision studies of a problem and solvers of one's own: every failure comes with its reason."""

import re
from math import inf

import numpy as np
import pytest

from polhode.harness import work_precision
from polhode.harness.work_precision import WorkPrecision
from polhode.models.problem import Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status
from polhode.solvers.solve import Interrupted, solve


def decay(ops):
    return lambda y, p: (-p[0] * y[0],)


class Idle(Solver):
    """Claims success without a step."""

    name = "idle"
    summary = accepts = ""

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        def integrate(record: Record) -> Outcome:
            return Status.REACHED_END, ""

        return integrate


class Raising(Idle):
    """Divides by zero."""

    name = "raising"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        return lambda record: (Status.REACHED_END, str(1 / (record.filled - 1)))


class Bare(Idle):
    """Returns a status alone."""

    name = "bare"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        return lambda record: Status.REACHED_END  # pyright: ignore


class Unprepared(Idle):
    """Raises before it runs."""

    name = "unprepared"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        raise ZeroDivisionError(settings.tolerance)


class Interrupting(Idle):
    """Ctrl-C comes while it runs, a row is no number."""

    name = "interrupting"

    def prepare(self, problem: Problem, settings: Settings) -> Integrator:
        def integrate(record: Record) -> Outcome:
            record.put(np.full_like(record.rows[1:2], np.nan))
            raise KeyboardInterrupt

        return integrate


PROBLEM = Problem("decay", decay, start=(1.0,), end=3.0, parameters=(2.0,))


def test_failures_stand_beside_successes_with_their_reasons():
    solvers = ["taylor", Idle(), Raising(), Bare(), Unprepared()]
    frame = WorkPrecision(PROBLEM, solvers=solvers, tolerances=(1e-6,), samples=4).frame
    good, bad, raising, bare, unprepared = frame.to_dict("records")
    assert (good["solver"], good["status"], good["error"] < 1e-5) == ("taylor", "reached_end", True)
    assert (bad["solver"], bad["status"]) == ("idle", "false_success")
    assert bad["message"] == "the library stopped at t = 0.0, expected 3.0"
    assert (raising["status"], bare["status"]) == ("crashed", "crashed")
    assert re.match(
        r"solver 'raising' raised ZeroDivisionError: .*test_work_precision.py:\d+: ",
        raising["message"],
    )
    assert (unprepared["status"], unprepared["message"][:27]) == (
        "crashed",
        "solver 'unprepared' raised ",
    )
    assert bare["message"].startswith("solver 'bare' returned <Status.REACHED_END")


def test_timed_runs_are_not_cut_by_the_limit(monkeypatch):
    limits = []
    monkeypatch.setattr(
        work_precision,
        "solve",
        lambda *args, **kw: limits.append(kw["max_seconds"]) or solve(*args, **kw),
    )
    _ = WorkPrecision(
        PROBLEM, solvers=["taylor"], tolerances=(1e-6,), samples=4, max_seconds=5.0
    ).frame
    assert limits[0] == 5
    assert set(limits[1:]) == {inf}


def test_ctrl_c_is_no_crash():
    with pytest.raises(Interrupted) as caught:
        solve(PROBLEM, Interrupting(), 1e-6)
    kept = caught.value.solution
    assert (kept.status, kept.success, kept.times.tolist()) == ("interrupted", False, [0.0])


NAMELESS = type("Nameless", (Solver,), {"prepare": Idle.prepare})()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"solvers": "taylor"}, r"solvers: got 'taylor', expected a sequence: \['taylor'\]"),
        ({"solvers": []}, r"solvers: got \[\], expected a sequence: \['taylor'\]"),
        ({"solvers": [Idle]}, r"solver: got 'Idle', expected an object, not the class: Idle\(\)"),
        (
            {"solvers": [decay]},
            "solver: got '<function decay .*expected a name, or an object of a class derived from",
        ),
        ({"solvers": [NAMELESS]}, "got 'Nameless', expected a class that has name"),
        ({"solvers": ["work_precision_absent:X"]}, "expected an importable module:class"),
        ({"samples": 1}, "^samples: got 1, expected a whole number from 2 to"),
        ({"samples": "a"}, "^samples: got 'a', expected a whole number from 2 to"),
        ({"tolerances": ()}, r"^tolerances: got \(\), expected positive numbers$"),
        ({"tolerances": 1e-3}, r"^tolerances: got 0.001, expected positive numbers$"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_a_line(given: dict, words: str):
    with pytest.raises(ValueError, match=words):
        _ = WorkPrecision(PROBLEM, **{"tolerances": (1e-6,), "quiet": True} | given).frame


RATE = 1.0


def decaying(t, y):
    return -RATE * y


def test_runs_and_reference_are_of_the_function_as_it_stands(monkeypatch):
    problem = Problem.from_function(decaying, [1.0], 1.0)
    for rate in (1.0, 2.0):
        monkeypatch.setitem(globals(), "RATE", rate)
        frame = WorkPrecision(problem, ["cyrk-vern8"], [1e-8], 5, quiet=True).frame
        assert frame["error"].max() < 1e-6
