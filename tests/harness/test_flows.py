"""Scenes in other flows than simple shear: files, solve, pick, events, restart, references, sweeps."""

import tomllib
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from commandline import Run

import polhode
from polhode.harness.commands.show import scene_text
from polhode.harness.common.store import read_export
from polhode.harness.ensembles.sweep import parse_sweep
from polhode.harness.flows.measure import AS_SHEAR
from polhode.harness.pages.figures.motion import body
from polhode.harness.references.reference import reference
from polhode.models.catalogue import form
from polhode.models.files.scene_file import parse_scene, read_scene, scene_table
from polhode.models.files.track_file import track_text
from polhode.models.flow import Flow, jeffery_spin
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid

pytestmark = pytest.mark.usefixtures("quickly_compiled")

START = EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0))
PLANAR = Scene(Ellipsoid((1.0, 0.8, 0.5)), 20.0, START, 60.0, Flow.planar(0.3))
TABLE = scene_table(PLANAR)


def test_a_scene_with_a_flow_is_the_same_from_its_file():
    text = scene_text(TABLE)
    assert "[flow]" in text
    assert parse_scene(tomllib.loads(text)) == PLANAR


def test_shear_has_no_key():
    shear = replace(PLANAR, flow=None)
    assert "flow" not in scene_table(shear)
    given = scene_table(shear) | {"flow": {"gradient": [[0, 1, 0], [0, 0, 0], [0, 0, 0]]}}
    assert parse_scene(given) == shear


@pytest.mark.parametrize(
    ("flow", "line"),
    [
        ({"gradient": [[1.0, 0, 0], [0, 0, 0], [0, 0, 0]]}, "flow.gradient: got the trace 1,"),
        ({"gradient": [[0.0, 1.0], [0, 0, 0], [0, 0, 0]]}, "flow.gradient[0]: got [0.0, 1.0], "),
        (
            {"gradient": [[float("nan"), 0, 0], [0, 0, 0], [0, 0, 0]]},
            "flow.gradient[0][0]: got nan",
        ),
        ({"gradeint": [[0.0, 1.0, 0.0]]}, "flow.gradeint: unknown key, expected one of gradient"),
        ({}, "flow: got neither"),
    ],
)
def test_what_is_wrong_with_a_flow_is_said_in_one_line(flow, line):
    with pytest.raises(ValueError, match="flow") as refusal:
        parse_scene(TABLE | {"flow": flow})
    assert str(refusal.value).startswith(line)
    assert "\n" not in str(refusal.value)


def test_solve_states_an_error_that_bounds_the_distance_from_the_reference():
    found = polhode.solve(PLANAR, error=1e-7, samples=101)
    known = reference(PLANAR, "quaternion", 101)
    assert known.slow_uncertainty < 1e-14
    apart = np.max(np.abs(found.observables.slow - known.observables.slow))
    assert apart / max(PLANAR.ellipsoid.inertia) < found.error.slow.high < 1e-6


def test_restart_goes_on_in_the_same_flow():
    whole = polhode.solve(PLANAR, error=1e-9)
    rest = whole.restart(20.0)
    assert rest.flow == PLANAR.flow
    again = polhode.solve(rest, error=1e-9)
    np.testing.assert_allclose(again.angular_momentum[-1], whole.angular_momentum[-1], atol=1e-8)
    np.testing.assert_allclose(again.rotation[-1], whole.rotation[-1], atol=1e-7)


def test_events_that_mean_something_in_shear_alone_say_so():
    found = polhode.solve(PLANAR, events=["lz", "separatrix"])
    for name, moments in found.events.items():
        assert len(moments.times), name
    with pytest.raises(ValueError, match=r"event 'settled': got the flow .* expected simple shear"):
        polhode.solve(PLANAR, events="settled")


@pytest.mark.parametrize("stokes", [0.0, 20.0, 1e4])
def test_pick_ranks_forms_that_hold_in_the_flow(stokes):
    scene = replace(PLANAR, ellipsoid=Ellipsoid((1.0, 1.0, 2.0)), stokes=stokes)
    ranking = polhode.pick(scene, 1e-6).ranking
    assert ranking
    for row in ranking:
        found = polhode.solve(
            scene, form=row.form, solver=row.solver, tolerance=row.tolerance, estimate=False
        )
        assert found.success, (row.form, row.solver)


def test_a_sweep_in_a_flow_has_full_equations_and_no_attractors():
    table = {
        "name": "extension",
        "title": "discs in axial extension",
        "shapes": [[1.0, 1.0, 0.3]],
        "stokes": [1e4],
        "slow_time": 0.01,
        "start": {"motion": "jeffery"},
        "flow": {"gradient": [list(row) for row in Flow.extension().gradient]},
        "particles": 40,
        "block": 40,
    }
    (ensemble,) = parse_sweep(table).ensembles
    assert ensemble.equations == "full"
    assert ensemble.attractors == ()
    (shear,) = parse_sweep({k: v for k, v in table.items() if k != "flow"}).ensembles
    assert "flow" not in shear.content
    assert "flow" in ensemble.content
    statistics = ensemble.run(0)
    assert statistics.as_record()
    drawn = ensemble.draw(0, 1)
    problem = ensemble.problem
    starts = drawn.states(ensemble.form, ensemble.ellipsoid)
    np.testing.assert_allclose(starts[0], problem.start, atol=1e-14)


@pytest.mark.parametrize("stokes", [0.0, 5.0])
def test_a_sweep_takes_one_track_for_each_particle(tmp_path, stokes):
    tracks = [track(), track(count=11)]
    for number, each in enumerate(tracks):
        path = tmp_path / f"{number}.csv"
        path.write_text(track_text(each), encoding="utf-8")
    table = {
        "name": "tracks",
        "title": "one track for each particle",
        "shapes": [[1.0, 1.0, 0.3]],
        "stokes": [stokes],
        "time": 20.0,
        "start": {"motion": "jeffery"},
        "flow": {"tracks": tmp_path.name},
        "particles": 6,
        "block": 4,
        "samples": 11,
    }
    (ensemble,) = parse_sweep(table, tmp_path.parent).ensembles
    statistics = ensemble.run(0)
    statistics.merge(ensemble.run(1))
    assert statistics.particles == 6
    assert not statistics.failures
    energies = []
    for number in range(6):
        block, place = divmod(number, 4)
        drawn = ensemble.draw(block, 4 if block == 0 else 2)
        start = BodyStart(
            tuple(drawn.quaternion[place].tolist()), tuple(drawn.angular_velocity[place].tolist())
        )
        scene = Scene(ensemble.ellipsoid, stokes, start, 20.0, tracks[number % 2])
        assert scene.angular_velocity == pytest.approx(
            jeffery_spin(scene.ellipsoid, scene.initial_rotation[None], tracks[number % 2].numbers)[
                0
            ]
        )
        found = polhode.solve(scene, error=1e-9, samples=11)
        energies.append(found.energy / max(scene.ellipsoid.inertia))
    mean = np.mean(energies, axis=0)
    np.testing.assert_allclose(statistics.slow[:, -1] / 6, mean, atol=1e-6)


def test_the_command_refuses_a_form_of_shear_in_one_line(here: Run, tmp_path):
    (tmp_path / "scene.toml").write_text(scene_text(TABLE), encoding="utf-8")
    done = here("solve", "scene.toml", "--form", "averaged", "--samples", "3")
    assert done.returncode == 2
    assert "not simple shear" in done.stderr
    assert "use 'quaternion'" in done.stderr
    assert here("solve", "scene.toml", "--samples", "3", "--tolerance", "1e-8").returncode == 0


# --- along a track --------------------------------------------------------------------------------


def track(count=31, time=60.0):
    """A track that changes smoothly from one planar flow to another."""
    times = np.linspace(0.0, time, count)
    gradients = [
        np.array(Flow.planar(0.3 * np.sin(0.2 * each)).gradient) + 0.2 * np.sin(0.5 * each) * TWIST
        for each in times
    ]
    return Flow.track(times, gradients)


TWIST = np.array([[0.0, 0.0, 1.0], [0.3, 0.2, 0.0], [0.0, -1.0, -0.2]])
TRACK = replace(PLANAR, flow=track())


def test_a_track_is_read_from_a_file_beside_the_scene(tmp_path):
    table = scene_table(PLANAR) | {"flow": {"track": "track.csv"}}
    text = scene_text(table)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    (tmp_path / "track.csv").write_text(track_text(TRACK.flow), encoding="utf-8")
    assert read_scene(tmp_path / "scene.toml") == TRACK
    assert parse_scene(tomllib.loads(scene_text(scene_table(TRACK)))) == TRACK


HEAD = "t,A11,A12,A13,A21,A22,A23,A31,A32,A33"
REST = ",0,1,0,0,0,0,0,0,0"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "track.csv', expected a file: there is none"),
        ("", "got the columns , expected t,A11,A12"),
        ("t,A11\n0,0", "got the columns t,A11, expected t,A11,A12"),
        (f"{HEAD}\n0{REST}\n1,0,1,0", "track.csv:3: got 4 columns, expected 10"),
        (f"\n{HEAD}\n\n0{REST}\n1,0,1,0", "track.csv:5: got 4 columns, expected 10"),
        (f"{HEAD}\n0{REST}\n1,0,x,0,0,0,0,0,0,0", "track.csv:3: got 1,0,x,0,0,0,0,0,0,0, expected"),
        (f"{HEAD}\n0{REST}\n0{REST}", "got t = 0.0 after 0.0, expected finite times that increase"),
        (f"{HEAD}\n0{REST}\n9{REST}", "got times from 0 to 9, expected the run, 0 to 60"),
        (
            f"{HEAD}\n0{REST}\n99,1,0,0,0,0,0,0,0,0",
            "flow.track at t = 99: got the trace 1, expected",
        ),
        (
            f"{HEAD}\n0{REST}\n99,nan,0,0,0,0,0,0,0,0",
            "flow.track at t = 99: got nan, expected finite",
        ),
    ],
)
def test_what_is_wrong_with_a_track_is_said_in_one_line(here: Run, tmp_path, text, words):
    table = scene_table(PLANAR) | {"flow": {"track": "track.csv"}}
    (tmp_path / "scene.toml").write_text(scene_text(table), encoding="utf-8")
    if text is not None:
        (tmp_path / "track.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="track") as refusal:
        read_scene(tmp_path / "scene.toml")
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)
    if text is None:
        done = here("solve", "scene.toml", "--samples", "3")
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1


def test_two_ways_to_give_a_flow_are_refused():
    flow = {"gradient": [[0.0, 1.0, 0.0], [0.0] * 3, [0.0] * 3], "track": "track.csv"}
    with pytest.raises(ValueError, match="flow: got gradient and track, expected one of"):
        parse_scene(TABLE | {"flow": flow})


@pytest.mark.parametrize("stokes", [0.0, 1.0, 1e3])
def test_stated_errors_bound_those_of_runs_along_tracks(stokes):
    scene = replace(TRACK, stokes=stokes)
    known = reference(scene, "quaternion", 61)
    found = polhode.solve(scene, error=1e-6, samples=61)
    apart = np.max(np.abs(found.observables.slow - known.observables.slow))
    assert apart / max(scene.ellipsoid.inertia) < found.error.slow.high < 1e-6


def test_dense_output_restart_and_events_along_a_track():
    whole = polhode.solve(TRACK, error=1e-10, samples=31, events=["lz"])
    moments = whole.events["lz"]
    assert len(moments.times)
    np.testing.assert_allclose(moments.angular_momentum[:, 2], 0.0, atol=1e-12)
    times = np.array([0.7, 21.3, 59.9])
    direct = polhode.solve(TRACK, error=1e-10, times=[0.0, *times, 60.0])
    np.testing.assert_allclose(
        whole(times).angular_momentum, direct.angular_momentum[1:4], atol=1e-9
    )
    rest = whole.restart(21.3)
    assert rest.time == pytest.approx(38.7)
    again = polhode.solve(rest, error=1e-10)
    np.testing.assert_allclose(again.angular_momentum[-1], whole.angular_momentum[-1], atol=1e-8)
    assert whole.equations.state_of(TRACK)[-1] == "t"


def test_pick_ranks_methods_along_a_track():
    for scene in (TRACK, replace(TRACK, ellipsoid=Ellipsoid((1.0, 1.0, 2.0)), stokes=1e4)):
        row = polhode.pick(scene, 1e-6).ranking[0]
        found = polhode.solve(scene, form=row.form, solver=row.solver, tolerance=row.tolerance)
        assert found.success
        assert found.error.slow.high < 1e-5


def test_a_study_takes_scenes_in_flows_and_along_tracks(tmp_path, here: Run):
    (tmp_path / "track.csv").write_text(track_text(track(count=13, time=12.0)), encoding="utf-8")
    (tmp_path / "study.toml").write_text(
        """\
name = "small"
title = "A small study"
samples = 11
max_seconds = 5.0
tolerances = [1e-5, 1e-8]
forms = ["quaternion", "averaged"]
solvers = ["cyrk-vern8", "taylor"]
[[scenes]]
name = "planar"
stokes = 5.0
time = 12.0
shape.semi_axes = [1.0, 0.8, 0.5]
start.euler_angles = [1.0, 0.5, 0.2]
start.euler_rates = [1.0, 1.0, -1.0]
flow.gradient = [[0.0, 1.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.0]]
[[scenes]]
name = "track"
stokes = 5.0
time = 12.0
shape.semi_axes = [1.0, 0.8, 0.5]
start.euler_angles = [1.0, 0.5, 0.2]
start.euler_rates = [1.0, 1.0, -1.0]
flow.track = "track.csv"
""",
        encoding="utf-8",
    )
    done = here("bench", "study.toml", "--out", "out", "--quiet")
    assert done.returncode == 0, done.stderr
    records = list(read_export(tmp_path / "out" / "records.jsonl.gz"))
    assert len(records) == 8
    for record in records:
        assert record["form"] == "quaternion"
        assert record["status"] == "reached_end"
        assert record["slow_error"] < 100 * record["tolerance"]


def test_work_precision_takes_problems_along_tracks():
    problem = form("quaternion").problem(replace(TRACK, time=10.0))
    study = polhode.WorkPrecision(
        problem, solvers=["cyrk-vern8", "taylor", "cvode-bdf"], tolerances=[1e-5, 1e-8]
    )
    frame = study.frame
    assert (frame["status"] == "reached_end").all()
    assert (frame["error"] < 100 * frame["tolerance"]).all()


@pytest.mark.parametrize("name", ["quaternion", "euler-angles"])
def test_shear_by_the_equations_of_any_flow_agrees_within_stated_errors(name):
    shear = replace(PLANAR, flow=None)
    pair = [
        polhode.solve(each, form=name, error=1e-7, samples=31)
        for each in (shear, replace(shear, flow=AS_SHEAR))
    ]
    slow = np.max(np.abs(pair[0].observables.slow - pair[1].observables.slow))
    slow = slow / max(shear.ellipsoid.inertia)
    assert slow <= sum(each.error.slow.high for each in pair) + 1e-14


def test_a_picture_shows_the_arrows_of_the_flow():
    flow = Flow(((0.5, 1.0, 0.3), (-0.2, -0.8, 0.1), (0.4, 0.0, 0.3)))
    steady = Flow.track([0.0, 1.0], [flow.gradient, flow.gradient])
    np.testing.assert_allclose(steady.gradient_at(0.4), flow.gradient, atol=1e-15)
    figure, axes = plt.subplots()
    drawn = body(axes, np.array([1.0, 0.8, 0.5]), np.eye(3), flow.gradient_at(0.0))
    tips = np.array([each.xy for each in drawn.texts])
    plain = body(figure.add_subplot(), np.array([1.0, 0.8, 0.5]), np.eye(3))
    assert np.max(np.abs(tips - [each.xy for each in plain.texts])) > 0.1
    plt.close(figure)
