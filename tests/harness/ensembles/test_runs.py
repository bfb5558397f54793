"""Particles in batches against the same particles alone, their starts against what each form makes of them."""

import re
import threading
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

from polhode.harness.ensembles.ensemble import Ensemble, Task, plan_of, run_task
from polhode.harness.ensembles.starts import Drawn, Starts
from polhode.models.catalogue import form as find_form
from polhode.models.files.toml_file import checked
from polhode.models.libraries import version_of
from polhode.models.observables import observe_body
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import attractors, circle
from polhode.solvers.compile import parameter_array
from polhode.solvers.ensembles.adaptive_steps import BENDS, DIFFERENCE, STAGES, run_adaptive
from polhode.solvers.ensembles.equal_steps import run
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.parts.schemes import dop853
from polhode.solvers.solve import solve

TRIAXIAL = Ellipsoid((0.8, 1.0, 0.5))
PROLATE = Ellipsoid((2.0, 1.0, 1.0))
OBLATE = Ellipsoid((1.0, 1.0, 0.5))
SHAPE_OF = {"quaternion": TRIAXIAL, "averaged": TRIAXIAL, "jeffery": TRIAXIAL}

ENSEMBLE_FORMS = ("quaternion", "spheroid-axis", "jeffery", "averaged", "averaged-spheroid")


def shape_of(form: str) -> Ellipsoid:
    return SHAPE_OF.get(form, PROLATE)


def scene_of(form: str, drawn: Drawn, index: int, slow_time: float) -> Scene:
    stokes = 0.0 if form == "jeffery" else 100.0
    q, w = (array[index].tolist() for array in (drawn.quaternion, drawn.angular_velocity))
    return Scene(shape_of(form), stokes, BodyStart(tuple(q), tuple(w)), slow_time * 100)


def draw(form: str, particles: int) -> Drawn:
    starts = Starts(motion="momentum-isotropic", angular_momentum=[0.0, 0.6, -0.8])
    return starts.draw(shape_of(form), np.random.SeedSequence(7), particles)


@pytest.mark.parametrize("form", ENSEMBLE_FORMS)
def test_starts_are_those_that_the_form_makes(form: str):
    drawn = draw(form, 5)
    states = drawn.states(form, shape_of(form))
    for index, state in enumerate(states):
        expected = find_form(form).problem(scene_of(form, drawn, index, 1.0)).start
        assert state == pytest.approx(expected, rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(
    "form", [name for name in ENSEMBLE_FORMS if not name.startswith("averaged")]
)
def test_particles_in_lanes_are_the_same_as_alone_and_one_that_blows_up_leaves_the_others_alone(
    form: str, monkeypatch: pytest.MonkeyPatch
):
    # Fewer lanes at once are compiled in a fraction of the time, and the particles fill more than
    # one batch.
    monkeypatch.setattr("polhode.solvers.ensembles.taylor_batch.REGISTERS", 1)
    drawn = draw(form, 11)
    problem = find_form(form).problem(scene_of(form, drawn, 0, 0.1))
    starts, times = drawn.states(form, shape_of(form)), np.linspace(0, problem.end, 6)
    states, statuses = run_batches(problem, starts, times, 1e-12)
    assert set(statuses) == {"reached_end"}
    planted, others = starts.copy(), np.arange(11) != 4
    planted[4] = np.inf
    beside, statuses = run_batches(problem, planted, times, 1e-12)
    assert statuses[4] == "non_finite"
    assert set(statuses[others]) == {"reached_end"}
    assert beside[:, others] == pytest.approx(states[:, others], abs=1e-13)
    for index in (0, 5, 10):
        alone = solve(replace(problem, start=tuple(starts[index])), "cyrk-vern8", 1e-13, times)
        assert states[:, index] == pytest.approx(alone.states, abs=1e-12)


def test_particles_in_lanes_have_parameters_of_their_own(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.solvers.ensembles.taylor_batch.REGISTERS", 1)
    drawn = draw("quaternion", 11)
    scenes = [
        replace(
            scene_of("quaternion", drawn, index, 0.1),
            ellipsoid=Ellipsoid((1.0, 0.8, 0.3 + 0.04 * index)),
            stokes=10.0 * (1 + index),
        )
        for index in range(11)
    ]
    problems = [find_form("quaternion").problem(scene) for scene in scenes]
    starts = np.array([problem.start for problem in problems])
    parameters = np.array([parameter_array(problem) for problem in problems])
    times = np.linspace(0, problems[0].end, 6)
    planted = starts.copy()
    planted[4] = np.inf
    states, statuses = run_batches(problems[0], planted, times, 1e-12, parameters)
    assert statuses[4] == "non_finite"
    for index in (0, 3, 5, 10):
        assert statuses[index] == "reached_end"
        alone = solve(problems[index], "cyrk-vern8", 1e-13, times)
        assert states[:, index] == pytest.approx(alone.states, abs=1e-11)


@pytest.mark.parametrize("form", ["averaged", "averaged-spheroid"])
def test_averaged_particles_agree_with_another_method(form: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.solvers.ensembles.adaptive_steps.AT_ONCE", 32)
    drawn = draw(form, 200)
    problem = find_form(form).problem(scene_of(form, drawn, 0, 0.05))
    starts, times = drawn.states(form, shape_of(form)), np.linspace(0, problem.end, 41)
    some = np.array([0, 150, 199])
    errors = []
    for tolerance in (1e-6, 1e-9):
        states, statuses = run_adaptive(problem, starts, times, tolerance)
        assert set(statuses) == {"reached_end"}
        assert np.isfinite(states).all()
        for index in some:
            alone = solve(
                replace(problem, start=tuple(starts[index])),
                "dop853",
                1e-10,
                times,
                backend="python",
            )
            errors.append(np.max(np.abs(states[:, index] - alone.states)))
    # The separatrix, where the field is not Lipschitz, may cost a factor; 1e-3 in tolerance must
    # show all the same.
    assert max(errors[:3]) < 1e-3
    assert max(errors[3:]) < 1e-5
    assert max(errors[3:]) < max(errors[:3]) / 10


def test_a_particle_that_fails_is_counted_and_left_out():
    form = "averaged-spheroid"
    drawn = draw(form, 20)
    problem = find_form(form).problem(scene_of(form, drawn, 0, 0.05))
    starts = drawn.states(form, shape_of(form))
    starts[3] = np.nan
    states, statuses = run_adaptive(problem, starts, np.array([0.0, problem.end]), 1e-6)
    assert statuses[3] == "step_underflow"
    assert np.isnan(states[-1, 3]).all()
    assert list(np.flatnonzero(statuses != "reached_end")) == [3]
    assert np.isfinite(states[-1, statuses == "reached_end"]).all()


def test_a_particle_whose_momentum_vanishes_is_given_up():
    drawn = draw("averaged", 20)
    problem = find_form("averaged").problem(scene_of("averaged", drawn, 0, 0.2))
    starts = drawn.states("averaged", TRIAXIAL)
    # L²/2E far below the smallest moment of inertia: what an error of E makes of a particle that
    # all but stops.
    starts[7] = [6.4e-5, 5.0e-5, -9.1e-6, 1.8e-6]
    states, statuses = run_adaptive(problem, starts, np.array([0.0, problem.end]), 1e-6)
    assert list(np.flatnonzero(statuses != "reached_end")) == [7]
    assert statuses[7] in ("step_limit", "step_underflow")
    assert np.isfinite(states[-1, statuses == "reached_end"]).all()


@pytest.mark.parametrize(
    ("motion", "momentum"),
    [
        ("rest", None),
        ("fluid", None),
        ("jeffery", None),
        ("momentum", [0.1, 0.2, -0.5]),
        ("momentum-isotropic", [1.0, 0.0, 0.0]),
    ],
)
def test_motions_of_the_start(motion, momentum):
    drawn = Starts(motion=motion, angular_momentum=momentum).draw(
        TRIAXIAL, np.random.SeedSequence(3), 4000
    )
    rotation = matrix_from_quaternion(drawn.quaternion)
    seen = observe_body(TRIAXIAL, rotation, drawn.angular_velocity)
    in_space = np.einsum("nij,ni->nj", rotation, drawn.angular_velocity)
    if motion == "rest":
        assert not drawn.angular_velocity.any()
    elif motion == "fluid":
        assert in_space == pytest.approx(np.tile([0, 0, -0.5], (4000, 1)), abs=1e-14)
    elif motion == "jeffery":
        scene = Scene(TRIAXIAL, 0.0, BodyStart(tuple(drawn.quaternion[9].tolist())), 1.0)
        assert drawn.angular_velocity[9] == pytest.approx(scene.angular_velocity, abs=1e-14)
    elif motion == "momentum":
        assert seen.angular_momentum / max(TRIAXIAL.inertia) == pytest.approx(
            np.tile(momentum, (4000, 1)), abs=1e-14
        )
    else:
        directions = seen.angular_momentum / max(TRIAXIAL.inertia)
        assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(4000))
        assert np.abs(directions.mean(axis=0)).max() < 4 / np.sqrt(3 * 4000)
    # Isotropy: every entry of t_ij has mean 0 and mean square 1/3, whose variances are 1/3 and
    # 4/45.
    assert np.abs(rotation.mean(axis=0)).max() < 4.5 / np.sqrt(3 * 4000)
    assert np.abs((rotation**2).mean(axis=0) - 1 / 3).max() < 4.5 * np.sqrt(4 / 45 / 4000)


def test_starts_depend_on_seed_and_block_alone():
    small = Ensemble(
        PROLATE,
        100.0,
        1.0,
        Starts(motion="fluid"),
        particles=20,
        block=10,
        seed=5,
        samples=3,
        snapshots=3,
    )
    other = replace(small, ellipsoid=TRIAXIAL, stokes=50.0)
    first, same = small.draw(1, 10).quaternion, other.draw(1, 10).quaternion
    assert np.array_equal(first, same)
    assert not np.array_equal(first, small.draw(0, 10).quaternion)
    assert not np.array_equal(first, replace(small, seed=6).draw(1, 10).quaternion)


def test_a_task_is_a_pure_function_in_any_thread():
    ensemble = Ensemble(
        PROLATE, 100.0, 5.0, Starts(motion="fluid"), particles=40, block=20, samples=5, snapshots=3
    )
    tasks = list(ensemble.tasks())
    assert len({task.key for task in tasks}) == 2
    alone = [run_task(task) for task in tasks]
    together: dict[int, object] = {}
    threads = [
        threading.Thread(target=lambda t=t: together.update({t.index: run_task(t)})) for t in tasks
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [together[0], together[1]] == alone


@pytest.mark.parametrize("other", ["polhode", "cyrk", "scipy"])
def test_a_task_of_other_versions_is_refused(monkeypatch: pytest.MonkeyPatch, other: str):
    task = Task(Ensemble(PROLATE, 100.0, 1.0, particles=2, samples=3, snapshots=3), 0)
    assert task.key
    found = {other: "0.0"}
    monkeypatch.setattr(
        "polhode.harness.ensembles.ensemble.version_of",
        lambda name: found.get(name) or version_of(name),
    )
    with pytest.raises(RuntimeError, match="other versions"):
        run_task(task)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"particles": 0}, "particles: got 0"),
        ({"particles": 2.5}, "particles: got 2.5, expected a whole number"),
        ({"samples": 10, "snapshots": 4, "block": 1}, None),
        ({"samples": 10, "snapshots": 3}, "snapshots: got 3"),
        ({"tolerance": 0.0}, "tolerance: got 0.0"),
        ({"equations": "averaged"}, "start.motion: got 'rest'"),
        ({"equations": "averaged", "starts": Starts(motion="fluid"), "stokes": 0.0}, "St = 0"),
        ({"stokes": -1.0}, "stokes: got -1.0"),
    ],
)
def test_bad_ensembles_get_one_line(changes, line):
    if line is None:
        assert replace(Ensemble(PROLATE, 100.0, 1.0), **changes)
        return
    with pytest.raises(ValueError, match=line) as refusal:
        replace(Ensemble(PROLATE, 100.0, 1.0), **changes)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("contents", "line"),
    [
        ({"motion": "spin"}, "motion: got 'spin', expected 'rest', 'fluid', 'jeffery'"),
        (
            {"motion": "momentum"},
            "got angular_momentum = None, expected three numbers, not all zero, with motion 'momentum'",
        ),
        (
            {"motion": "momentum", "angular_momentum": [0.0, 0.0, 0.0]},
            "(0.0, 0.0, 0.0), expected three numbers, not all zero",
        ),
        (
            {"angular_momentum": [1.0, 0.0, 0.0]},
            "(1.0, 0.0, 0.0), expected none with motion 'rest'",
        ),
        (
            {"angular_momentum": [1.0, 0.0]},
            "angular_momentum: got [1.0, 0.0], expected at least 3 items",
        ),
        (
            {"orientation": [0.0, 0.0, 0.0, 0.0]},
            "got orientation = (0.0, 0.0, 0.0, 0.0), expected four numbers",
        ),
    ],
)
def test_bad_starts_get_one_line(contents, line):
    with pytest.raises(ValueError, match=re.escape(line)) as refusal:
        checked(Starts, contents)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("ellipsoid", [PROLATE, Ellipsoid((1.0, 0.8, 0.5))])
def test_particles_circle_their_attractor_at_the_distance_stated(ellipsoid: Ellipsoid):
    stokes = 2000.0
    (attractor,) = attractors(ellipsoid, stokes, 1e-9, circling=True)
    axis = ellipsoid.order[2]
    velocity = {0: (-0.5, 0.0, 0.0), 2: (0.0, 0.0, -0.5)}[axis]
    q = {0: (0.5, -0.5, -0.5, -0.5), 2: (1.0, 0.0, 0.0, 0.0)}[axis]
    scene = Scene(ellipsoid, stokes, BodyStart(q, velocity), stokes)
    assert scene.initial_rotation[axis] == pytest.approx([0, 0, 1], abs=1e-15)
    form = find_form("quaternion")
    solution = solve(form.problem(scene), "cyrk-vern8", 1e-12, np.linspace(0, scene.time, 20001))
    seen = form.observe(scene, solution.states[10000:])
    distance = np.linalg.norm(seen.slow / max(ellipsoid.inertia) - attractor.state, axis=1)
    assert attractor.reach == pytest.approx(circle(ellipsoid, stokes) + 1e-9)
    assert distance.max() == pytest.approx(circle(ellipsoid, stokes), rel=20 / stokes)


@pytest.mark.parametrize(
    ("ellipsoid", "names"),
    [(PROLATE, ["equatorial axis"]), (OBLATE, ["symmetry axis"]), (TRIAXIAL, ["shortest axis"])],
)
def test_the_attractor_is_rotation_about_the_shortest_axis(ellipsoid: Ellipsoid, names: list[str]):
    found = attractors(ellipsoid, 1e4, 0.01, circling=True)
    assert [attractor.rotation for attractor in found] == names
    assert found[0].state == pytest.approx([0, 0, -0.5, 0.125])
    assert attractors(ellipsoid, 0.0, 0.01, circling=True) == ()
    assert attractors(Ellipsoid((1.0, 1.0, 1.01)), 1e4, 0.05, circling=True) == ()


def test_coefficients_are_those_of_scipys_classes():
    assert [row[: k + 1] for k, row in enumerate(RK45.A[1:].tolist())] == [
        list(row) for row in STAGES[:-1]
    ]
    assert (RK45.B.tolist(), RK45.E.tolist()) == (list(STAGES[-1]), [-each for each in DIFFERENCE])
    assert RK45.P[:, 3].tolist() == list(BENDS)
    table = dop853()
    assert np.array_equal(table.A[: table.N_STAGES, : table.N_STAGES], DOP853.A)
    assert np.array_equal(table.B, DOP853.B)


def test_a_run_compared_with_itself_states_the_error_of_the_reference():
    """The search for steps once ended at the reference's own method and steps, and stated the error 0."""
    ensemble = Ensemble(Ellipsoid((1.0, 0.97, 2.0)), 100.0, 100.0, tolerance=1e-6)
    chosen = plan_of(ensemble)
    assert chosen is not None
    problem = ensemble.problem
    starts = ensemble.draw(0, 32).states(ensemble.form, ensemble.ellipsoid)
    times = np.linspace(0.0, problem.end, ensemble.samples)
    states, _ = run(problem, starts, times, ensemble.tolerance, chosen)
    exact = [
        solve(replace(problem, start=tuple(start)), "cyrk-dop853", 1e-13, times).states
        for start in starts.tolist()
    ]
    errors = np.abs(states - np.stack(exact, axis=1)).max(axis=(0, 2))
    # Distances of the sample count over the largest component at the start, at least 1.
    assert 0 < np.quantile(errors, 0.9) <= chosen.error <= ensemble.tolerance
