"""What a solution of a scene can do: between its rows, events, other containers, going on where it ended."""

from dataclasses import replace
from functools import cache
from io import StringIO
from math import pi

import numpy as np
import pytest

from polhode import Scene, SceneSolution, solve
from polhode.harness.events import ARRIVED, EVENTS, Event, as_events, happened
from polhode.harness.solution import _ROWS_PER_NOTE, COLUMNS, OMEGA, write_csv
from polhode.models.files.scene_file import parse_scene, scene_table
from polhode.models.problem import Problem
from polhode.models.scenes import named_scene
from polhode.solvers.solve import solve as run

pytestmark = pytest.mark.usefixtures("quickly_compiled")

RNG = np.random.default_rng(5)


@cache
def found(
    scene: str, form: str, solver: str = "cyrk-vern8", tolerance: float = 1e-13, samples: int = 51
) -> SceneSolution:
    return solve(scene, form=form, solver=solver, tolerance=tolerance, samples=samples)


@pytest.mark.parametrize(
    ("scene", "form", "solver"),
    [
        ("paper", "quaternion", "cyrk-vern8"),
        ("paper", "quaternion", "dop853"),
        ("paper", "averaged", "cvode-adams"),
        ("paper", "averaged", "cyrk-radau"),
        ("spheroid", "spheroid-axis", "splitting"),
        ("spheroid", "averaged-second-order", "cyrk-dop853"),
    ],
)
def test_between_the_rows_it_is_as_accurate_as_in_them(scene: str, form: str, solver: str):
    coarse = found(scene, form, solver, 1e-7)
    times = RNG.uniform(0, coarse.times[-1], 60)
    exact, exact_rows = (found(scene, form)(t).observables for t in (times, coarse.times))
    run_error = np.max(np.abs(coarse.observables.slow - exact_rows.slow))
    assert np.max(np.abs(coarse(times).observables.slow - exact.slow)) < 10 * run_error < 1e-2


def test_at_its_rows_it_is_the_rows_and_beyond_them_nothing():
    solution = found("paper", "quaternion")
    again = solution(solution.times[::-1])
    np.testing.assert_array_equal(again.states, solution.states[::-1])
    assert solution(3.0).energy.shape == (1,)
    for t in (-1e-9, 500.1, np.nan):
        with pytest.raises(ValueError, match="expected times from 0 to 500"):
            solution(t)
    for t in ("x", [[1.0, 2.0], [3.0, 4.0]], [[1.0, 2.0], [3.0]], 1j):
        with pytest.raises(
            ValueError, match=r"^t: got .*, expected a number or an array of one dimension$"
        ):
            solution(t)


def test_names_of_solve_ivp():
    solution = found("paper", "quaternion", "radau", 1e-4)
    assert solution.y.shape == (7, len(solution.t))
    assert solution.sol(1.0).shape == (7,)
    assert solution.sol([1.0, 2.0]).shape == (7, 2)
    assert (solution.nfev, solution.njev) == (solution.work.rhs_calls, solution.work.jacobians)


def test_other_times_need_neither_begin_nor_end_with_the_scene():
    wanted = [0.3, 7.0, 7.1]
    solution = solve("paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-13, times=wanted)
    assert solution.times.tolist() == wanted
    np.testing.assert_allclose(
        solution.states, found("paper", "quaternion")(wanted).states, atol=1e-12
    )
    slow = solve("paper", form="averaged", solver="cyrk-vern8", tolerance=1e-13, times=wanted)
    np.testing.assert_allclose(slow.energy, found("paper", "averaged")(wanted).energy, atol=1e-12)
    bad: list
    for bad in ([], [2.0, 1.0], [0.0], [1.0, 501.0], [[1.0]]):
        with pytest.raises(ValueError, match="times: got"):
            solve("paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-9, times=bad)


def oscillator(ops):
    return lambda y, p: (y[1], -y[0])


@pytest.mark.parametrize("solver", ["taylor", "cyrk-dop853", "dop853", "cvode-adams"])
def test_events_are_found_to_ten_digits(solver: str):
    """y = cos t, with fewer rows than passages: at π/2 it falls, at 3π/2 it rises."""
    problem = Problem("oscillator", oscillator, (1.0, 0.0), 20.0)
    solution = run(problem, solver, 1e-13, np.linspace(0, 20.0, 4))
    zeros = (np.arange(6) + 0.5) * pi
    for direction, expected in ((0.0, zeros), (-1.0, zeros[::2]), (1.0, zeros[1::2])):
        event = Event("y", lambda each: each.y[0], direction)
        np.testing.assert_allclose(happened(solution, event).t, expected, rtol=1e-10)


def test_events_of_a_scene_do_not_depend_on_rows_and_solver():
    way = {"form": "quaternion", "events": ["separatrix", "lz"]}
    one = solve("paper", solver="taylor", tolerance=1e-15, **way).events
    other = solve("paper", solver="cyrk-vern8", tolerance=1e-13, samples=5, **way).events
    assert [len(each.t) for each in one.values()] == [3, 1]
    for name, each in one.items():
        np.testing.assert_allclose(other[name].t, each.t, rtol=1e-10)
    middle = sorted(named_scene("paper").ellipsoid.inertia)[1]
    np.testing.assert_allclose(
        np.sum(one["separatrix"].angular_momentum ** 2, axis=1),
        2 * middle * one["separatrix"].energy,
        rtol=1e-12,
    )
    assert one["lz"].angular_momentum[0, 2] == pytest.approx(0, abs=1e-12)


def test_a_terminal_event_is_the_end():
    settled = replace(EVENTS["settled"], terminal=True)
    scene = replace(named_scene("paper"), time=3000.0)
    solution = solve(
        scene, form="averaged", solver="cyrk-vern8", tolerance=1e-12, events=[settled, "lz"]
    )
    assert solution.success
    assert solution.times[-1] == solution.events["settled"].times[0] < 3000
    shortest = max(scene.ellipsoid.inertia)
    at_rest_with_the_flow = np.array([0, 0, -0.5, 0.125])
    assert np.linalg.norm(
        solution.observables.slow[-1] / shortest - at_rest_with_the_flow
    ) == pytest.approx(ARRIVED)
    assert len(solution.frame()) == len(solution.states)
    with pytest.raises(ValueError, match="expected times from 0 to"):
        solution(solution.times[-1] + 1)


def test_events_that_do_not_happen_are_empty():
    never, end = Event("never", lambda s: s.energy - 100), replace(EVENTS["lz"], terminal=True)
    for events in ([never], [never, end]):
        solution = solve(
            "paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-9, events=events
        )
        assert [len(each.t) for each in solution.events.values()] == [0, 1][: len(events)]


def test_events_before_the_first_time_of_the_output_are_found():
    way = {"form": "quaternion", "solver": "cyrk-vern8", "tolerance": 1e-13, "estimate": False}
    whole, late = (
        solve("paper", events=["separatrix", "lz"], times=times, **way)
        for times in (None, [400.0, 500.0])
    )
    assert late.times.tolist() == [400, 500]
    for name, each in whole.events.items():
        np.testing.assert_allclose(late.events[name].times, each.times, rtol=1e-9)
        assert each.times[-1] < 400
    ended = solve("paper", events=replace(EVENTS["lz"], terminal=True), times=[400.0, 500.0], **way)
    assert (
        ended.times.tolist()
        == ended.events["lz"].times.tolist()
        == pytest.approx(whole.events["lz"].times)
    )


def test_of_a_run_that_fails_at_once_nothing_happens():
    failed = run(
        Problem("root", lambda ops: lambda y, p: (ops.sqrt(y[0]),), (-1.0,), 1.0),
        "cyrk-vern8",
        1e-8,
    )
    assert (failed.status, len(failed.t)) == ("non_finite", 1)
    assert len(happened(failed, Event("y", lambda each: each.y[0])).t) == 0


def test_what_is_no_number_has_not_passed_zero():
    found = run(Problem("line", lambda ops: lambda y, p: (1.0,), (-1.0,), 3.0), "cyrk-vern8", 1e-8)
    with np.errstate(invalid="ignore"):
        assert len(happened(found, Event("log", lambda each: np.log(each.y[0]) + 9)).t) == 0


def test_an_event_of_what_the_form_does_not_know_is_refused():
    with pytest.raises(
        ValueError, match=r"^event 'up': got no numbers, expected what the form knows"
    ):
        solve("paper", form="averaged", events=[Event("up", lambda each: each.rotation[:, 2, 2])])


def test_an_event_beside_the_start_is_found():
    line = run(Problem("line", lambda ops: lambda y, p: (1.0,), (0.0,), 3.0), "cyrk-vern8", 1e-8)
    jump = happened(line, Event("jump", lambda each: np.where(each.t > 1e-60, 1.0, -1.0)))
    assert jump.t == pytest.approx([1e-60], rel=1e-9)


def test_a_false_success_stays_one_at_an_event_that_ends_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.harness.answers.confirmed.doubt", lambda *_: "it stood still")
    given = {"form": "quaternion", "solver": "cyrk-vern8", "tolerance": 1e-6, "samples": 11}
    stopped = solve(
        "paper", **given, events=[Event("half", lambda each: each.times - 250.0, terminal=True)]
    )
    assert (stopped.status, stopped.message, stopped.times[-1]) == (
        "false_success",
        "it stood still",
        250.0,
    )


def found_twice(solution: SceneSolution) -> np.ndarray:
    return solution.angular_momentum[:, 2]


found_twice.terminal = -1  # pyright: ignore


@pytest.mark.parametrize(
    ("events", "words"),
    [
        (
            ["seperatrix"],
            "got 'seperatrix', expected one of separatrix, lz, settled, or a function .did you mean",
        ),
        (["lz", "lz"], "expected each once: give a function by def, or Event"),
        ([found_twice], "terminal: got -1, expected True, False or a positive whole number"),
    ],
)
def test_refused_events(events: list, words: str):
    with pytest.raises(ValueError, match=words):
        as_events(events)


def test_at_an_event_the_error_is_compared_with_the_whole_run():
    solution = solve(
        "paper", form="quaternion", solver="cyrk-vern8", tolerance=1e-9, samples=21, events=["lz"]
    )
    words = [line for line in repr(solution).splitlines() if "error:" in line]
    assert "% of the largest |L_z|" in words[0]
    assert [line for line in repr(solution.events["lz"]).splitlines() if "error:" in line] == words
    assert "L_z" not in replace(solution.error, largest_lz=1e-17).words()


def test_what_is_missing_names_the_extra(monkeypatch: pytest.MonkeyPatch, tmp_path):
    monkeypatch.setattr("polhode.models.libraries.installed", lambda library: False)
    with pytest.raises(
        ImportError, match=r"pyarrow is not installed: pip install 'polhode\[data\]'"
    ):
        found("paper", "quaternion").to_parquet(tmp_path / "a.parquet")
    with pytest.raises(
        ImportError, match=r"xarray is not installed: pip install 'polhode\[data\]'"
    ):
        found("paper", "quaternion").to_xarray()


def test_refused_functions():
    with pytest.raises(
        ValueError, match=r"event 'off': got AttributeError: .*enrgy.* \(.*test_solution.py:\d+: "
    ):
        happened(found("paper", "quaternion"), Event("off", lambda each: each.enrgy))
    with pytest.raises(ValueError, match=r"got values of shape \(\d+, 3\), expected"):
        happened(found("paper", "quaternion"), Event("wrong", lambda each: each.angular_momentum))
    with pytest.raises(ValueError, match="expected a stable state to reach"):
        happened(found("top", "quaternion"), EVENTS["settled"])
    with pytest.raises(
        ValueError, match="event 'separatrix': got the kind 'prolate', expected a triaxial"
    ):
        happened(found("spheroid", "spheroid-axis"), EVENTS["separatrix"])
    for share in (0.9, 0.999999):
        event = Event("share", lambda each, share=share: each.energy - share * each.energy[0])
        with pytest.raises(
            ValueError, match=r"event 'share': got .*, expected values that depend on their own row"
        ):
            happened(found("paper", "averaged"), event)


def test_a_mistake_in_an_event_is_found_before_the_run(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.harness.answers.runs.solve", None)
    with pytest.raises(ValueError, match="event 'off': got AttributeError"):
        solve("paper", events=Event("off", lambda each: each.enrgy))


@pytest.mark.parametrize(
    ("scene", "form"), [("paper", "quaternion"), ("spheroid", "spheroid-axis")]
)
def test_angular_velocity_is_that_of_the_quaternion_form_and_of_the_start(scene: str, form: str):
    omega, full = found(scene, form).angular_velocity, found(scene, "quaternion")
    np.testing.assert_allclose(
        omega, np.einsum("nij,ni->nj", full.rotation, full.states[:, 4:]), atol=1e-9
    )
    start = named_scene(scene)
    np.testing.assert_allclose(
        omega[0], start.initial_rotation.T @ np.array(start.angular_velocity), atol=1e-14
    )


@pytest.mark.parametrize(
    ("scene", "form"),
    [
        ("paper", "quaternion"),
        ("spheroid", "spheroid-axis"),
        ("paper", "averaged"),
        ("plate", "spheroid-axis"),
    ],
)
def test_a_scene_from_the_middle_goes_on_as_the_run_did(scene: str, form: str):
    whole = found(scene, form)
    half = whole.times[-1] / 3
    rest = parse_scene(scene_table(whole.restart(half)))
    assert rest.time == pytest.approx(whole.times[-1] - half)
    more = solve(rest, form=form, solver="cyrk-vern8", tolerance=1e-13, samples=11)
    expected = whole(np.minimum(more.times + half, whole.times[-1]))
    np.testing.assert_allclose(more.observables.slow, expected.observables.slow, atol=1e-9)
    np.testing.assert_allclose(more.rotation, expected.rotation, atol=1e-8)


def test_a_scene_from_the_end_lasts_as_long_again():
    scene = found("paper", "quaternion").restart()
    assert isinstance(scene, Scene)
    assert scene.time == 500
    assert found("paper", "quaternion").restart(100.0, time=7.0).time == 7
    with pytest.raises(ValueError, match=r"^time: got 0"):
        found("paper", "quaternion").restart(time=0.0)
    with pytest.raises(ValueError, match=r"^t: got \[1, 2\], expected a number"):
        found("paper", "quaternion").restart([1, 2])


def test_other_containers():
    solution = found("paper", "quaternion")
    frame, data = solution.frame(omega=True), solution.to_xarray()
    assert list(frame.columns) == COLUMNS + OMEGA
    assert (data.attrs["form"], data.attrs["solver"], frame.attrs["tolerance"]) == (
        "quaternion",
        "cyrk-vern8",
        1e-13,
    )
    np.testing.assert_array_equal(data["omega"].sel(space="z"), frame["wz"])
    np.testing.assert_array_equal(data["R"].sel(body=3, space="x"), frame["R31"])
    assert "<th>solver</th><td>cyrk-vern8 at tolerance 1e-13</td>" in solution._repr_html_()
    segments = solve("paper", form="hybrid", tolerance=1e-6, samples=11)
    assert all(isinstance(each, str | float | int) for each in segments.to_xarray().attrs.values())


@pytest.mark.parametrize("form", ["hybrid", "averaged-second-order", "quaternion", "averaged"])
@pytest.mark.parametrize("scene", ["paper", "spheroid"])
def test_the_form_names_the_columns_of_its_states(scene: str, form: str):
    short = replace(named_scene(scene), stokes=1e4, time=100.0)
    if form == "averaged" and scene == "spheroid":
        form = "averaged-spheroid"
    solution = solve(
        short, form=form, solver="cyrk-dop853", tolerance=1e-6, samples=3, estimate=False
    )
    assert len(solution.equations.state_of(short)) == solution.states.shape[1]


def test_parquet(tmp_path):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    solution = found("paper", "quaternion")
    solution.to_parquet(tmp_path / "a.parquet", omega=True)
    pd.testing.assert_frame_equal(
        pd.read_parquet(tmp_path / "a.parquet"), solution.frame(omega=True)
    )


def test_writing_rows_tells_the_share_that_is_written():
    shares: list[float] = []
    write_csv(StringIO(), np.zeros((_ROWS_PER_NOTE + 1, len(COLUMNS))), shares.append)
    assert shares == pytest.approx([1 - 1 / (_ROWS_PER_NOTE + 1), 1.0])
