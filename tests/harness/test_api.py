"""The Python API: what people import, what they get."""

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from commandline import SCENE, Run

from polhode import (
    Ellipsoid,
    EulerStart,
    Problem,
    Scene,
    SceneSolution,
    WorkPrecision,
    pick,
    solve,
    solve_ivp,
)
from polhode.harness.answers.confirmed import meet
from polhode.harness.answers.rules import Method
from polhode.harness.answers.runs import Runner
from polhode.harness.api import as_scene, plan
from polhode.harness.pages.figures.motion import slow_variables
from polhode.harness.pages.figures.style import GREY
from polhode.harness.pages.figures.work_precision import UNKNOWN_LABEL
from polhode.models.catalogue import form
from polhode.models.form import Form
from polhode.models.forms.quaternion import Quaternion
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status
from polhode.solvers.solve import Interrupted
from polhode.solvers.taylor import Taylor

pytestmark = pytest.mark.usefixtures("quickly_compiled")

WAY = {"form": "quaternion", "solver": "cyrk-vern8", "tolerance": 1e-10}


@pytest.fixture(scope="module")
def solution() -> SceneSolution:
    return solve("paper", **WAY)


def test_names_are_imported_on_first_use():
    code = (
        "import sys, polhode as h\n"
        "assert not {'numpy', 'pandas', 'scipy', 'heyoka'} & set(sys.modules)\n"
        "assert {'solve', 'pick', 'WorkPrecision', 'SceneSolution'} <= set(dir(h))\n"
        "import polhode.harness.answers.pick\n"
        "from polhode import pick, solve, WorkPrecision\n"
        "assert pick.__name__ == 'pick' and callable(pick)\n"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr


def test_what_is_not_there_is_an_attribute_error():
    import polhode

    with pytest.raises(AttributeError, match=r"'polhode' has no attribute 'sovle'"):
        polhode.sovle  # noqa: B018


def test_a_scene_a_file_and_a_name_are_the_same(tmp_path: Path, solution: SceneSolution):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    for scene in (path, str(path), named_scene("paper")):
        pd.testing.assert_frame_equal(solve(scene, **WAY).frame(), solution.frame())


def test_objects_stand_for_their_names(solution: SceneSolution):
    same = solve("paper", form=Quaternion(), solver=Taylor(), tolerance=1e-10)
    assert (same.form, same.solver) == ("quaternion", "taylor")
    pd.testing.assert_frame_equal(same.frame(), solution.frame())


def test_frame_is_the_csv(here: Run, scene_file: Path, tmp_path: Path):
    options = [word for name, value in WAY.items() for word in (f"--{name}", value)]
    done = here("solve", scene_file.name, *options, "--samples", 11, "--out", "out.csv")
    assert done.returncode == 0, done.stderr
    header, *rows = (tmp_path / "out.csv").read_text().splitlines()
    frame = solve(scene_file, **WAY, samples=11).frame()
    assert list(frame.columns) == header.split(",")
    assert frame.to_numpy().tolist() == [[float(text) for text in row.split(",")] for row in rows]


@pytest.mark.parametrize(("name", "t2"), [("jeffery", np.nan), ("top", 0.0)])
def test_slow_time_at_the_limits(name: str, t2: float):
    found = solve(
        name,
        form={"jeffery": "jeffery", "top": "euler-top"}[name],
        solver="exact",
        tolerance=1e-9,
        samples=5,
    )
    np.testing.assert_array_equal(found.frame()["t2"], [t2] * 5)


def test_averaged_forms_count_time_in_shear_units_and_know_no_rotation():
    scene = named_scene("paper")
    found = solve(scene, form="averaged", solver="cyrk-vern8", tolerance=1e-9)
    assert found.times[-1] == pytest.approx(scene.time)
    assert found.slow_times[-1] == pytest.approx(0.5)
    assert found.frame()[["R11", "R33"]].isna().all(axis=None)


@pytest.mark.parametrize("times", [None, [500.0]])
def test_left_to_choose_it_meets_the_error(solution: SceneSolution, times: list[float] | None):
    found = solve("paper", error=1e-4, times=times)
    assert found.success
    true = solution if times is None else solution(times)
    difference = np.max(np.abs(found.observables.slow - true.observables.slow))
    assert difference < 1e-4 * max(found.scene.ellipsoid.inertia)


def test_an_object_of_the_catalogue_is_chosen_for_as_its_name():
    by_name, by_object = (
        plan("paper", each, None, None, 1e-6, "slow", 201) for each in ("quaternion", Quaternion())
    )
    assert (by_object.solver, by_object.tolerance) == (by_name.solver, by_name.tolerance)


def test_an_object_whose_class_stands_within_a_function_is_chosen_for():
    class Own(Quaternion):
        name = "own"

    class OwnTaylor(Taylor):
        name = "own-taylor"

    form, method = Own(), OwnTaylor()
    chosen = plan("paper", form, method, None, 1e-6, "slow", 201)
    assert (chosen.form, chosen.solver) == (form, method)
    assert plan("paper", form, None, None, 1e-6, "slow", 201).form is form


@pytest.mark.parametrize("name", ["confirmation", "doubt"])
def test_ctrl_c_beside_a_run_keeps_it(name: str, monkeypatch: pytest.MonkeyPatch):
    def interrupted(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"polhode.harness.answers.confirmed.{name}", interrupted)
    with pytest.raises(Interrupted) as caught:
        solve("paper", **WAY)
    assert (caught.value.solution.status, len(caught.value.solution.times)) == ("reached_end", 201)


def test_ctrl_c_in_a_second_method_keeps_the_run_of_the_first(monkeypatch: pytest.MonkeyPatch):
    scene = as_scene("paper")
    runner = Runner(scene, np.linspace(0.0, scene.time, 11))
    # Tsitouras' method of order 5 does not meet an error near rounding.
    methods = [Method(Quaternion(), find_solver(solver)) for solver in ("cyrk-tsit5", "cyrk-vern8")]
    run = Runner.run

    def interrupted(self: Runner, method: Method, *given, **named):
        if method is methods[1]:
            raise Interrupted(replace(run(self, method, *given, **named).solution, message="begun"))
        return run(self, method, *given, **named)

    monkeypatch.setattr(Runner, "run", interrupted)
    with pytest.raises(Interrupted) as caught:
        meet(runner, methods, 1e-13, "slow")
    assert caught.value.solution.message != "begun"
    assert len(caught.value.solution.times) == 11


def test_ctrl_c_in_a_confirming_run_of_another_form_keeps_the_finished_run(monkeypatch):
    """The rows are those of the form whose motion they are taken for."""
    run = Runner.run

    def interrupted(self: Runner, method: Method, *given, **named):
        if method.form.name != "euler-angles":
            raise Interrupted(run(self, method, *given, **named).solution)
        return run(self, method, *given, **named)

    monkeypatch.setattr(Runner, "run", interrupted)
    with pytest.raises(Interrupted) as caught:
        solve("paper", form="euler-angles", error=1e-6)
    assert caught.value.solution.problem.name == "euler-angles"


def test_solutions_pickle(solution: SceneSolution):
    copy = pickle.loads(pickle.dumps(solution))
    pd.testing.assert_frame_equal(copy.frame(), solution.frame())
    assert (copy.status, copy.scene, copy.work) == (solution.status, solution.scene, solution.work)


def test_failure_is_a_status_with_the_rows_so_far():
    # Euler angles through their pole: the run cannot reach its end.
    start = EulerStart((1e-4, 0.3, 0.2), (-1e-5, 0.0, 0.0))
    scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 1e6, start, 40.0)
    found = solve(scene, form="euler-angles", solver="cyrk-vern8", tolerance=1e-8, samples=201)
    assert found.status in (Status.NON_FINITE, Status.STEP_UNDERFLOW)
    assert 1 < len(found.frame()) == len(found.times) < 201
    # Of no row that was asked for the start is left.
    assert solve(
        scene, form="euler-angles", solver="cyrk-vern8", tolerance=1e-8, times=[40.0]
    ).times.tolist() == [0.0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"samples": 1}, "samples: got 1, expected a whole number from 2 to"),
        ({"samples": 2.5}, "samples: got 2.5, expected a whole number from 2 to"),
        (
            {"form": "quaternoin"},
            "form: got 'quaternoin' .did you mean 'quaternion'.., expected one of",
        ),
        ({"tolerance": -1.0}, "tolerance: got -1.0, expected a number from 1e-16"),
        ({"tolerance": 1e-300}, "tolerance: got 1e-300, expected a number from 1e-16"),
        ({"form": "spheroid-axis"}, "use 'quaternion'"),
        # Checked even where form, solver and tolerance leave nothing open.
        ({"want": "foo"}, "^want: got 'foo', expected 'slow' or 'orientation'$"),
        ({"error": "1e-6"}, "^error: got '1e-6', expected a number"),
        ({"tolerance": "1e-8"}, "^tolerance: got '1e-8', expected a number"),
        ({"tolerance": [1e-8]}, r"^tolerance: got \[1e-08\], expected a number"),
        ({"tolerance": None, "error": None}, "^error: got None, expected a number"),
        (
            {"times": [1.0, 2.0], "samples": 5},
            "^samples: got 5 beside times, expected one of them$",
        ),
        ({"times": "now"}, "^times: got 'now', expected increasing numbers from 0 to 500$"),
        (
            {"times": [0.0, None, 1.0]},
            r"^times: got \[0.0, None, 1.0\], expected increasing numbers",
        ),
        ({"times": [0.0, "1"]}, r"^times: got \[0.0, '1'\], expected increasing numbers"),
        (
            {"times": [0.0, [1.0, 2.0]]},
            r"^times: got \[0.0, \[1.0, 2.0\]\], expected increasing numbers",
        ),
        (
            {"events": None},
            "^events: got None, expected one of separatrix, lz, settled, or a function$",
        ),
        ({"events": [3]}, "^events: got 3, expected one of separatrix"),
        ({"events": [["lz"]]}, r"^events: got \['lz'\], expected one of separatrix"),
    ],
)
def test_refusals_name_value_and_expectation(change: dict, words: str):
    with pytest.raises(ValueError, match=words):
        solve("paper", **WAY | change)


def test_a_form_without_what_every_form_has_is_refused_in_a_line():
    methods = {"check": Quaternion.check, "problem": Quaternion.problem}
    bare = type(
        "Bare", (Form,), {"name": "bare", "state": ("q",), "observe": Quaternion.observe, **methods}
    )()
    with pytest.raises(
        ValueError, match=r"^form: got 'Bare', expected a class that has orientation$"
    ):
        solve("paper", form=bare)
    with pytest.raises(
        ValueError,
        match=r"^form: got 'Quaternion', expected an object, not the class: Quaternion\(\)$",
    ):
        solve("paper", form=Quaternion)  # pyright: ignore


def test_pick_takes_a_name_and_gives_what_solve_takes():
    best = pick("paper", error=1e-5, want="orientation").ranking[0]
    assert solve("paper", form=best.form, solver=best.solver, tolerance=best.tolerance).success


def test_work_precision_is_a_frame():
    problem = form("quaternion").problem(named_scene("paper"))
    study = WorkPrecision(problem, solvers=("taylor",), tolerances=(1e-4, 1e-8))
    assert list(study.frame["status"]) == ["reached_end"] * 2
    assert study.frame["error"].is_monotonic_decreasing
    assert study.frame["known"].all()


def test_points_that_the_reference_cannot_tell_are_grey():
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    problem = replace(form("quaternion").problem(named_scene("paper")), end=5.0)
    study = WorkPrecision(
        problem, solvers=("taylor", "cyrk-vern8"), tolerances=(1e-4, 1e-8), samples=11
    )
    exact, _ = study.reference
    limit = study.frame["error"].sort_values().iloc[1]
    # A study anew, with a reference that is known less well.
    unsure = WorkPrecision(
        problem, solvers=("taylor", "cyrk-vern8"), tolerances=(1e-4, 1e-8), samples=11
    )
    unsure.__dict__["reference"] = exact, limit / 10
    errors = unsure.frame["error"]
    assert unsure.frame["known"].tolist() == (errors > limit).tolist()
    figure, axes = plt.subplots()
    unsure.plot(axes)
    grey = [line for line in axes.get_lines() if line.get_color() == GREY]
    points = sorted(float(x) for line in grey for x in line.get_xdata())
    assert points == sorted(errors[errors <= limit])
    assert set(axes.get_legend_handles_labels()[1]) == {
        "Pareto front",
        "taylor",
        "cyrk-vern8",
        UNKNOWN_LABEL,
    }
    plt.close(figure)


def branching(t, y):
    return [np.heaviside(y[0] - 1.5, 0.5) + 1]


def test_a_kink_that_taylors_method_steps_over_is_in_the_reference():
    """The solution goes from 1 to 2.5; Taylor's method, which sees no kink, goes to 2."""
    problem = Problem.from_function(branching, [1.0], 1.0)
    study = WorkPrecision(
        problem, solvers=("taylor", "cyrk-dop853"), tolerances=(1e-8,), quiet=True
    )
    states, uncertainty = study.reference
    assert abs(states[-1, 0] - 2.5) <= uncertainty < 1e-6
    statuses = dict(zip(study.frame["solver"], study.frame["status"], strict=True))
    assert statuses == {"taylor": "false_success", "cyrk-dop853": "reached_end"}
    assert len(repr(study)) < 600


@pytest.mark.parametrize("given", ["paper", None, branching])
def test_a_study_of_what_is_no_problem_is_refused_in_one_line(given):
    with pytest.raises(
        ValueError, match=r"^problem: got .*, expected a Problem: Problem.from_function"
    ):
        WorkPrecision(given)


def test_results_like_those_of_solve_ivp_pickle():
    found = solve_ivp(branching, (0, 1), [1.0])
    assert pickle.loads(pickle.dumps(found)).sol(0.25) == found.sol(0.25)


def test_plots_take_and_return_axes(solution: SceneSolution):
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots()
    assert slow_variables(axes, solution, names=("Lz", "E")) is axes
    size = max(solution.scene.ellipsoid.inertia)
    np.testing.assert_allclose(axes.lines[0].get_ydata(), solution.angular_momentum[:, 2] / size)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), solution.energy / size)
    assert axes.get_xlabel().startswith("slow time")
    plt.close(figure)


def test_a_printed_solution_is_short():
    found = solve("paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-8, samples=11)
    lines = repr(found).splitlines()
    assert lines[0] == "SceneSolution"
    assert "  solver: cyrk-vern8 at tolerance 1e-8" in lines
    assert "  rows: 11, t = 0 to 500" in lines
    assert len(lines) < 10


@pytest.mark.parametrize("kind", [list, np.array, lambda each: tuple(np.float32(each))])
def test_scenes_of_lists_arrays_and_single_precision_are_solved_in_doubles(kind):
    """As data from a file of particles are; numbers that single precision holds, so that the motion is the same."""
    axes, angles, rates, stokes, time = (
        (1.0, 0.75, 0.5),
        (1.0, 0.5, 0.0),
        (1.0, 1.0, -1.0),
        7.0,
        50.0,
    )
    own = Scene(Ellipsoid(axes), stokes, EulerStart(angles, rates), time)
    start = EulerStart(kind(angles), kind(rates))
    like = Scene(Ellipsoid(kind(axes)), np.float32(stokes), start, np.float32(time))
    runs = [
        solve(each, form="quaternion", solver="cyrk-vern8", tolerance=1e-12, estimate=False)
        for each in (own, like)
    ]
    assert np.array_equal(runs[0].states, runs[1].states)
    assert pick(like).ranking == pick(own).ranking
    assert as_scene(own) is own


def test_an_error_to_pick_for_is_a_number():
    for error in (None, "1e-6", [1e-6], True):
        with pytest.raises(ValueError, match=r"^error: got .*, expected a number"):
            pick("paper", error)  # pyright: ignore
    assert pick("paper", np.float32(1e-6)).error == float(np.float32(1e-6))  # pyright: ignore


@pytest.mark.parametrize("given", [None, 3, {"stokes": 10.0}])
def test_what_is_no_scene_is_refused_in_one_line(given):
    with pytest.raises(ValueError, match="expected a Scene, a file or a built-in scene's name"):
        solve(given)


def test_ctrl_c_while_events_are_looked_for_keeps_the_run():
    calls = 0

    def interrupted(motion):
        nonlocal calls
        calls += 1
        # The first call is at the start, before the run.
        if calls > 1:
            raise KeyboardInterrupt
        return motion.t - 1.0

    with pytest.raises(Interrupted) as stop:
        solve("paper", events=interrupted)
    assert stop.value.solution.success


def test_an_event_may_have_no_value_at_the_start():
    def share(motion):
        size = np.linalg.norm(motion.angular_momentum, axis=1)
        with np.errstate(invalid="ignore"):
            return motion.angular_momentum[:, 2] / size + 0.5

    assert np.isnan(share(solve("rest-500"))[0])
    assert solve("rest-500", events=share).success
