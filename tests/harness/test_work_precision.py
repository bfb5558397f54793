"""Work-precision studies of a problem and solvers of one's own: every failure comes with its reason."""

import json
import re
from math import inf
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from commandline import Run
from scipy.integrate import solve_ivp as scipys

from polhode.harness import work_precision
from polhode.harness.references import any_problem
from polhode.harness.references.any_problem import _PAIRS, OwnReference, _by_pair, reference_of
from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.work_precision import WorkPrecision, side_by_side
from polhode.models.problem import Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Solver, Status
from polhode.solvers.solve import Interrupted, solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")


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
    # Those that only prepare the solver come before.
    counted, *timed = [limit for limit in limits if limit > 1e-6]
    assert counted == 5
    assert set(timed) == {inf}


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
            r"^solver: got decay\(ops\), expected mine\(f, t_span, y0, t_eval, rtol, atol\) -> states",
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


def brusselator(t, y, feed, rate):
    reaction = y[0] ** 2 * y[1]
    return [feed + reaction - (rate + 1) * y[0], rate * y[0] - reaction]


BRUSSELATOR = Problem.from_function(brusselator, [1.5, 3.0], 20.0, [1.0, 3.0])


def rk23(f, t_span, y0, t_eval, rtol, atol, method="RK23"):
    return scipys(f, t_span, y0, method, t_eval, rtol=rtol, atol=atol).y.T


def failing(f, t_span, y0, t_eval, rtol, atol):
    return f(0.0, y0)[5]


def short_of_rows(f, t_span, y0, t_eval, rtol, atol):
    return np.zeros((2, 2))


def test_functions_options_and_labels_stand_beside_the_catalogue():
    solvers = {
        "ours": "cyrk-vern7",
        "small steps": ("cyrk-vern7", {"max_step": 0.01}),
        "theirs": rk23,
        "theirs of order 8": (rk23, {"method": "DOP853"}),
        "failing": failing,
        "short": short_of_rows,
    }
    study = WorkPrecision(BRUSSELATOR, solvers, [1e-6], quiet=True)
    rows = {row["solver"]: row for row in study.frame.to_dict("records")}
    assert list(rows) == list(solvers)
    assert rows["theirs"]["status"] == "reached_end"
    assert 1e-6 < rows["theirs"]["error"] < 1e-2
    assert rows["theirs of order 8"]["error"] < rows["theirs"]["error"]
    assert rows["theirs"]["rhs_calls"] > 1000
    assert rows["small steps"]["steps"] >= 2000 > rows["ours"]["steps"]
    assert rows["failing"]["status"] == "crashed"
    assert re.match(
        r"failing raised IndexError: .*test_work_precision.py:\d+: ", rows["failing"]["message"]
    )
    assert (
        rows["short"]["message"] == "short returned shape (2, 2), expected states of shape (101, 2)"
    )
    assert set(study.best()["family"]) == {"CyRK", "function"}
    # One of the catalogue, and every function.
    assert len(study.best()) == 5


@pytest.mark.parametrize(
    ("solvers", "words"),
    [
        (
            [("radau", {"maxstep": 1.0})],
            r"got the option 'maxstep' \(did you mean 'max_step'\?\), expected one of atol, backend",
        ),
        (["radau", "radau"], "got 'radau' twice, expected labels"),
    ],
)
def test_setups_that_mean_nothing_are_refused(solvers, words):
    with pytest.raises(ValueError, match=words):
        _ = WorkPrecision(BRUSSELATOR, solvers, [1e-6], quiet=True).frame


def pulse(t, y):
    return [np.exp(-(((t - 47.3) / 3.0) ** 2))]


def spike(t, y):
    return [-0.1 * y[0] + np.exp(-(((t - 47.3) / 0.02) ** 2))]


@pytest.mark.parametrize(
    ("f", "start", "right"),
    [
        (pulse, 0.0, 3 * np.sqrt(np.pi)),
        (spike, 1.0, np.exp(-10.0) + 0.02 * np.sqrt(np.pi) * np.exp(-5.27 + 0.001**2)),
    ],
)
def test_references_see_pulses_that_taylors_method_steps_over(f, start, right):
    study = WorkPrecision(Problem.from_function(f, [start], 100.0), ["radau"], [1e-8], quiet=True)
    states, uncertainty = study.reference
    assert float(states[-1, 0]) == pytest.approx(right, rel=1e-8)
    assert uncertainty < 1e-9
    # The solver may step over it, and err by what its error then says.
    row = study.frame.iloc[0]
    assert row["status"] == "false_success" or row["error"] <= 0.1


def test_stiff_references_are_those_of_unlike_implicit_methods():
    def robertson(t, y):
        slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        return [back - slow, slow - back - fast, fast]

    problem = Problem.from_function(robertson, [1.0, 0.0, 0.0], 1e11)
    study = WorkPrecision(problem, ["cvode-bdf", "bdf"], [1e-6], 11, 1.0, quiet=True)
    assert study.source == "cyrk-radau at 1e-11, compared with cvode-bdf at 1e-11"
    ends = [0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050]
    np.testing.assert_allclose(study.reference[0][-1], ends, rtol=1e-6)


def test_own_references_are_functions_arrays_and_runs():
    decay_ = Problem.from_function(lambda t, y: -2.0 * y, [1.0], 3.0)
    run = scipys(
        lambda t, y: -2.0 * y, (0, 3), [1.0], "DOP853", rtol=1e-13, atol=1e-13, dense_output=True
    )
    given = (lambda t: np.exp(-2.0 * t), np.exp(-2.0 * np.linspace(0, 3, 5))[:, None], run)
    errors = [
        WorkPrecision(decay_, ["rk45"], [1e-4], 5, quiet=True, reference=one).frame["error"][0]
        for one in (None, *given)
    ]
    assert errors == pytest.approx([errors[0]] * 4, rel=1e-6)
    with pytest.raises(
        ValueError, match=r"reference: got shape \(3, 1\), expected states of shape"
    ):
        _ = WorkPrecision(decay_, ["rk45"], [1e-4], 5, quiet=True, reference=np.ones((3, 1))).frame


def test_errors_are_chosen():
    def error(**choice):
        study = WorkPrecision(BRUSSELATOR, ["cyrk-tsit5"], [1e-4], 21, quiet=True, **choice)
        return study.frame["error"][0]

    final, mean, largest = error(error="final"), error(error="L2"), error()
    assert final <= largest
    assert mean < largest
    assert error(relative=False) > largest
    with pytest.raises(ValueError, match="error: got 'mean', expected one of max, final, L2"):
        error(error="mean")


def test_times_are_the_runs_alone():
    study = WorkPrecision(BRUSSELATOR, ["cyrk-dop853"], [1e-4], quiet=True)
    row = study.frame.iloc[0]
    alone = min(
        solve(study.problem, "cyrk-dop853", 1e-4, study.times, atol=row["atol"]).seconds
        for _ in range(20)
    )
    assert row["seconds"] < 3 * alone
    assert row["compile_seconds"] > 0
    assert row["trace_seconds"] > 0


def test_a_study_over_a_parameter_and_its_page(tmp_path: Path):
    study = WorkPrecision(
        BRUSSELATOR,
        ["cyrk-vern7", "cyrk-bdf"],
        [1e-4, 1e-7],
        21,
        quiet=True,
        over={"rate": [1.0, 3.0]},
    )
    assert study.frame["rate"].tolist() == [1.0] * 4 + [3.0] * 4
    assert study.frame["known"].all()
    page = study.write(tmp_path).read_text(encoding="utf-8")
    assert "## Time to an error of 0.001" in page
    assert re.search(r"\| 3 +\| cyrk-bdf +\| 1e-07", page)
    assert json.loads((tmp_path / "runs.json").read_text())["over"] == {"rate": [1.0, 3.0]}
    assert {"over.png", "work-precision.png", "runs.csv"} <= {
        one.name for one in tmp_path.iterdir()
    }
    with pytest.raises(ValueError, match=r"over: got 'rates' .*did you mean 'rate'"):
        _ = WorkPrecision(BRUSSELATOR, ["cyrk-vern7"], over={"rates": [1.0]}).frame


def test_a_function_of_parameters_makes_the_problems():
    def sized(n):
        return Problem.from_function(lambda t, y: -np.arange(1.0, n + 1) * y, [1.0] * int(n), 1.0)

    frame = WorkPrecision(sized, ["cyrk-vern7"], [1e-6], 5, quiet=True, over={"n": [1, 3]}).frame
    assert frame["n"].tolist() == [1, 3]


def test_figures_name_problem_tolerances_and_solvers():
    study = WorkPrecision(BRUSSELATOR, ["cyrk-vern7", "radau"], [1e-4, 1e-6], 21, quiet=True)
    axes = study.plot(plt.figure().gca())
    assert axes.get_title(loc="left") == "brusselator, rtol 0.0001 to 1e-06"
    assert {"cyrk-vern7", "radau"} <= {line.get_label() for line in axes.get_lines()}
    assert len(side_by_side([study, study], best=True).axes) == 2
    plt.close("all")


def test_a_file_names_the_problem_of_a_page(here: Run, tmp_path: Path):
    (tmp_path / "mine.py").write_text(
        "from polhode import Problem\n"
        "def decay(t, y): return -y\n"
        "problem = Problem.from_function(decay, [1.0], 1.0)\n"
    )
    words = "bench", f"{tmp_path}/mine.py:problem", "--quick", "--quiet", "--solver", "cyrk-vern7"
    done = here(*words, "--out", tmp_path / "page")
    assert done.returncode == 0, done.stderr
    assert "decay, rtol 0.0001 to 1e-10" in (tmp_path / "page" / "README.md").read_text()
    refused = here("bench", f"{tmp_path}/mine.py:other")
    assert refused.returncode == 2
    assert "got no 'other', expected the name of a Problem in it" in refused.stderr


def test_a_reference_ends_with_the_limit():
    root = Problem.from_function(lambda t, y: [-1 / y[0]], [1.0], 1.0)
    frame = WorkPrecision(root, ["radau"], [1e-6], max_seconds=2.0, quiet=True).frame
    assert not frame["known"].any()
    assert frame["error"].isna().all()


def test_a_stiff_problem_has_an_implicit_reference():
    """Explicit methods get through Robertson's problem to t = 1e4, far from its solution."""

    def robertson(t, y):
        a, b, c = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
        return [b - a, a - b - c, c]

    problem = Problem.from_function(robertson, [1.0, 0.0, 0.0], 3e3)
    times = np.linspace(0.0, 3e3, 11)
    pair = _by_pair(problem, times, _relative, 60.0, _PAIRS[1])
    assert isinstance(pair, OwnReference)
    assert pair.uncertainty < 1e-7


def _relative(states, exact):
    return float((np.abs(states - exact).max(axis=0) / np.abs(exact).max(axis=0)).max())


def test_a_pair_that_differs_gives_way_to_the_next_one(monkeypatch):
    problem = Problem.from_function(lambda t, y: [-y[0]], [1.0], 1.0)
    monkeypatch.setattr(any_problem, "_by_taylor", _no_taylor)
    found = {"cyrk-vern8": 0.2, "cyrk-radau": 1e-9}

    def by_pair(problem, times, measure, max_seconds, pair):
        name = pair.solvers[0]
        return OwnReference(np.ones((2, 1)), found[name], name)

    monkeypatch.setattr(any_problem, "_by_pair", by_pair)
    for least, source in ((1e-9, "cyrk-radau"), (0.3, "cyrk-vern8")):
        found["cyrk-radau"] = least
        assert reference_of(problem, np.array([0.0, 1.0]), _relative, 1.0).source == source


def _no_taylor(*arguments):
    raise ReferenceFailedError("not asked")


def test_a_reference_has_as_many_components_as_the_problem():
    problem = Problem.from_function(lambda t, y: [y[1], -y[0]], [1.0, 0.0], 5.0)
    reference = lambda t: [np.cos(t), -np.sin(t), 99.0]  # noqa: E731
    study = WorkPrecision(problem, ["radau"], tolerances=(1e-5,), reference=reference, quiet=True)
    with pytest.raises(ValueError, match=r"reference: got shape \(101, 3\), expected states"):
        _ = study.frame


def test_functions_are_families_of_their_own():
    problem = Problem.from_function(lambda t, y: [-y[0]], [1.0], 1.0)

    def exact(f, span, y0, t_eval, rtol, atol):
        return np.exp(-t_eval)[:, None]

    def other(f, span, y0, t_eval, rtol, atol):
        return np.exp(-t_eval)[:, None]

    study = WorkPrecision(problem, {"a": exact, "b": other}, (1e-5,), 21, quiet=True)
    assert list(study.best()["solver"]) == ["a", "b"]


def test_a_run_without_a_result_looks_hollow_and_is_in_the_legend():
    import matplotlib.pyplot as plt

    def broken(f, span, y0, t_eval, rtol, atol):
        raise RuntimeError("no")

    problem = Problem.from_function(lambda t, y: [-y[0]], [1.0], 1.0)
    study = WorkPrecision(problem, ["taylor", broken], (1e-3, 1e-6), 21, quiet=True)
    figure, axes = plt.subplots(dpi=300)
    study.plot(axes)
    labels = axes.get_legend_handles_labels()[1]
    assert labels.count("broken: no result") == 1
    line = next(line for line in axes.get_lines() if line.get_label() == "broken: no result")
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    right, up = line.get_transform().transform(line.get_xydata())[0]
    middle = picture[len(picture) - 1 - round(up), round(right)]
    around = picture[len(picture) - 1 - round(up) :][:20, round(right) - 20 : round(right) + 20]
    plt.close(figure)
    assert middle.min() == 255, "the middle of the marker is filled"
    assert around.min() < 128, "there is no marker"


def algebraic(t, y, k):
    return [-k * y[0], y[1] - 2 * y[0]]


def test_parameters_of_algebraic_equations_reach_the_solver():
    problem = Problem.from_function(algebraic, [1.0, 2.0], 1.0, [1.0], mass=[1, 0])
    frame = WorkPrecision(
        problem,
        ["ida"],
        tolerances=(1e-8,),
        over={"k": [1.0, 3.0]},
        reference=lambda t, k: [np.exp(-k * t), 2 * np.exp(-k * t)],
        quiet=True,
    ).frame
    assert list(frame["status"]) == [Status.REACHED_END] * 2
    assert (frame["error"] < 1e-6).all()


def test_a_function_gets_no_algebraic_equations():
    problem = Problem.from_function(algebraic, [1.0, 2.0], 1.0, [1.0], mass=[1, 0])
    row = WorkPrecision(problem, {"mine": rk23}, tolerances=(1e-6,), quiet=True).frame.iloc[0]
    assert row["status"] == "refused"
    assert row["message"] == "the mass matrix is singular, and a function gets f alone"


def test_a_parameter_beside_a_mass_matrix_is_known_by_name():
    problem = Problem.from_function(
        lambda t, y, k: [-k * y[0], y[0]], [1.0, 0.0], 1.0, [1.0], mass=[1, 2]
    )
    study = WorkPrecision(problem, ["dop853"], tolerances=(1e-6,), over={"k": [1.0, 2.0]})
    ends = [one.reference[0][-1, 0] for _, one in study.studies]
    assert ends == pytest.approx([np.exp(-1), np.exp(-2)], rel=1e-9)


def test_values_of_a_parameter_may_be_read_once():
    study = WorkPrecision(
        Problem.from_function(lambda t, y, k: [-k * y[0]], [1.0], 1.0, [1.0]),
        ["dop853"],
        over={"k": iter([1.0, 2.0])},
    )
    assert [point for point, _ in study.studies] == [{"k": 1.0}, {"k": 2.0}]


@pytest.mark.parametrize("values", [3.0, [], "12"])
def test_values_of_a_parameter_are_a_sequence(values):
    problem = Problem.from_function(decaying, [1.0], 1.0)
    with pytest.raises(ValueError, match="expected values of 'k' in a sequence, at least one"):
        WorkPrecision(problem, ["dop853"], over={"k": values})


def test_a_function_for_atol_that_fails_is_named():
    problem = Problem.from_function(decaying, [1.0], 1.0)
    study = WorkPrecision(
        problem, ["dop853"], tolerances=(1e-6,), atol=lambda rtol: 1 / 0, quiet=True
    )
    with pytest.raises(ValueError, match=r"atol: got ZeroDivisionError: .*test_work_precision"):
        _ = study.frame
