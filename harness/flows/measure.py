"""Measurements in linear flows: a function for each table of the page, rows as plain data.

The page is `reports/flows`; `docs/flows.md` has flows and tracks. A linear flow has the velocity A x
with a gradient A of trace 0. A track is a gradient over time, given at knots and joined by cubic
splines. "Apart" says how far two results differ. Keys of times end in their unit, as in `track_ms`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf, pi, sqrt
from typing import Any

import numpy as np

from polhode.harness.api import solve as solve_scene
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record
from polhode.harness.events import Event
from polhode.harness.flows.space_frame import Bodies, run as integrate
from polhode.harness.references.errors import orientation_difference
from polhode.models.catalogue import form as find_form
from polhode.models.flow import Flow
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import EulerStart, Scene
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.compile import compiled_callback
from polhode.solvers.solve import Solution, solve
from polhode.solvers.taylor import forget_integrators

# Shear but for an entry A₂₁ of 1e-300, far below rounding. It is not recognised as shear, so that the
# equations of any flow run.
AS_SHEAR = Flow.planar(1e-300)
# Forms that take any linear flow.
_FORMS = ("quaternion", "euler-angles", "spheroid-axis", "spheroid-angles", "jeffery")
# θ, φ, ψ in rad and their rates in shear rates: a start without symmetry.
START = EulerStart((1.1, 0.4, 0.3), (1.0, 1.0, -1.0))

# Random states of each form at which the fields are compared, shared evenly by random shapes. Both numbers are
# estimates: more of them find larger differences of rounding, if any.
_STATES = 10_000
_SHAPES = 100
_QUICK_SHAPES = 5  # With `quick`.
# Least and largest decade of random semi-axes, over any one length, and of random St. Estimates.
_AXIS_DECADES = (-1, 0)
_STOKES_DECADES = (-1, 3)
# Seeds of the states, of the random scenes and of the errors requested of these; any numbers.
_STATES_SEED = 1
_SCENES_SEED = 11
_ERRORS_SEED = 12

# Tolerance and duration, in inverse shear rates, of the runs whose cost is compared: estimates, by which
# runs take some milliseconds.
COST_TOLERANCE = 1e-9
COST_TIME = 2000.0
_QUICK_COST_TIME = 200.0  # With `quick`.
# Times that heyoka compiles a field: the same code takes up to 1.5 times as long, by where it lies
# in memory. Other solvers keep their code, so that for them this only makes more rounds. An estimate.
COMPILATIONS = 5
# Timed runs of each compilation; the fastest of all compilations counts. An estimate.
ROUNDS = 3
# Explicit solvers, which take every form of `_COSTS`.
_EXPLICIT = ("cyrk-vern8", "cyrk-dop853", "taylor")
# Scene, form, St and solvers of these runs. St = 10, an example, is one where full equations are usual;
# `jeffery` is the form at St = 0.
_COSTS = (
    ("paper", "quaternion", 10.0, _EXPLICIT),
    ("spheroid", "euler-angles", 10.0, _EXPLICIT),
    ("spheroid", "spheroid-axis", 10.0, (*_EXPLICIT, "splitting")),
    ("spheroid", "spheroid-angles", 10.0, _EXPLICIT),
    ("paper", "jeffery", 0.0, _EXPLICIT),
)

# Planar flows A₁₂ = 1, A₂₁ = α, and aspect ratios of the spheroids in them. The flow is rotation at α = -1,
# shear at 0, extension at 1. Spheroids align beyond an α that depends on the ratio. The values are estimates: they
# lie on both sides of the threshold of each ratio.
_ALPHAS = (-0.9, -0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
_RATIOS = (0.25, 1.5, 2.0, 5.0)
_ORBIT_TOLERANCE = 1e-14  # Of the solver: periods are compared to rounding.
# Duration of the run that measures a period, over the period. Three passages through a plane lie within 1.5
# periods from any phase, as they are half a period apart. The rest is on the safe side.
_PERIODS = 1.6
# Time, in inverse shear rates, in which an axis aligns to rounding, if the flow makes it align. An
# estimate: the tables show how closely axes align by then.
ALIGNING = 400.0
# Bodies in axial extension: a rod, which aligns along the axis of extension, and a disc, which aligns across it.
# The aspect ratios, the St and the tolerance are estimates.
_EXTENDED_RATIOS = ((3.0, "along"), (0.3, "across"))
_EXTENDED_STOKES = (0.0, 0.5, 5.0)
_EXTENDED_TOLERANCE = 1e-13

# Runs along tracks that show the order of the spline. They have this duration, in inverse shear rates, and these
# numbers of intervals between knots, which the tables call knots. Estimates.
TRACK_TIME = 20.0
_KNOTS = (10, 20, 40, 80, 160, 320)
# Equal steps of the run in long double in that time, and the tolerance of the other runs. Estimates: the errors of
# both lie far below the splines' errors.
_TRACK_STEPS = 200
_TRACK_TOLERANCE = 1e-15
# The same for runs that show the cost of a knot. Estimates.
LONG_TRACK_TIME = 100.0
_LONG_TRACK_KNOTS = (100, 300, 1000)
# Solvers whose cost of a knot is measured.
_TRACK_SOLVERS = ("cyrk-vern8", "cyrk-dop853", "cyrk-tsit5", "taylor", "cvode-bdf", "dop853")

# Random runs whose stated errors are compared with an integration in long double. An estimate: four times as
# many would halve the interval of the share that is bounded.
_RUNS = 400
_QUICK_RUNS = 16  # With `quick`.
# Equal steps of that integration: a multiple of the intervals between knots, and of those between compared
# times. An estimate.
_RUN_STEPS = 600
_RUN_KNOTS = 30  # Intervals between the knots of a track; an estimate.
_RUN_ROWS = 11  # Compared times; an estimate.
_RUN_TIME = 30.0  # Longest duration, in inverse shear rates; an estimate.
# Least and largest duration over the longest one.
_RUN_TIMES = (0.2, 1.0)
# Decades of the damping rate max(8πX/I)/St, in shear rates. It is 3.2 at most: explicit steps in long double
# stay stable.
_RUN_DAMPING_DECADES = (-2, 0.5)
# θ₀ in rad: it keeps away from 0 and π, where Euler angles are singular.
_RUN_THETAS = (0.3, 2.8)
_FULL_TURN = 6.28  # Largest φ₀ and ψ₀ in rad, 2π in three digits.
# Size of the fluctuation of a track over the size of the flow that it fluctuates about.
_RUN_FLUCTUATION = 0.5
# Decades of the errors that are requested, of L and E over I_max: from near rounding to what is of use.
_RUN_ERROR_DECADES = (-9, -3)


def random_gradient(random: np.random.Generator) -> Any:
    """A gradient of trace zero, shape (3, 3): entries have the variance 1/3 before the trace is taken out."""
    gradient = random.normal(size=(3, 3)) / sqrt(3)
    return gradient - np.eye(3) * np.trace(gradient) / 3


def fields(quick: bool = False) -> Iterator[Record]:
    """Largest relative difference of rates by the equations of any flow and of shear."""
    random = np.random.default_rng(_STATES_SEED)
    shapes = _QUICK_SHAPES if quick else _SHAPES
    states_of_shape = _STATES // _SHAPES
    for name in _FORMS:
        worst = 0.0
        for _ in range(shapes):
            axes = 10 ** random.uniform(*_AXIS_DECADES, 3)
            if name.startswith("spheroid"):
                axes[1] = axes[0]
            stokes = 0.0 if name == "jeffery" else float(10 ** random.uniform(*_STOKES_DECADES))
            scene = Scene(Ellipsoid(tuple(axes.tolist())), stokes, START, 1.0)
            pair = [find_form(name).problem(variant) for variant in (scene, _as_shear(scene))]
            for state in random.normal(size=(states_of_shape, pair[0].dimension)):
                shear_rates, flow_rates = (_rates(problem, state) for problem in pair)
                difference = np.linalg.norm(flow_rates - shear_rates)
                worst = max(worst, float(difference / np.linalg.norm(shear_rates)))
        yield {"form": name, "states": shapes * states_of_shape, "apart": worst}


def _as_shear(scene: Scene) -> Scene:
    """The scene in shear, by the equations of any flow."""
    return replace(scene, flow=AS_SHEAR)


def _rates(problem: Any, state: np.ndarray) -> np.ndarray:
    """Rates at a state, from the machine code that solvers call."""
    parameters = np.array(problem.parameters)
    rates = np.empty(len(state))
    compiled_callback(problem.field, len(state), len(parameters))(state, parameters, rates)
    return rates


def _one_round(problems: Sequence[Problem], solver: str) -> list[Solution]:
    """A run of each problem."""
    return [solve(problem, solver, COST_TOLERANCE) for problem in problems]


def _in_turns(problems: Sequence[Problem], solver: str, *, quick: bool) -> list[list[Solution]]:
    """Runs of the problems, one after the other in every round: a list for each round."""
    rounds = []
    for _ in range(1 if quick else COMPILATIONS):
        forget_integrators()
        # The round that compiles is not timed.
        _one_round(problems, solver)
        rounds += [_one_round(problems, solver) for _ in range(ROUNDS)]
    return rounds


def _least_seconds(runs: Sequence[Solution]) -> float:
    """Seconds of the fastest run."""
    return min(run.seconds for run in runs)


def costs(quick: bool = False) -> Iterator[Record]:
    """Times by the equations of any flow and of shear, in turns; the least of `COMPILATIONS` times `ROUNDS`."""
    for scene_name, name, stokes, solvers in _COSTS:
        time = _QUICK_COST_TIME if quick else COST_TIME
        scene = replace(named_scene(scene_name), stokes=stokes, time=time)
        pair = [find_form(name).problem(variant) for variant in (scene, _as_shear(scene))]
        for solver in solvers:
            rounds = _in_turns(pair, solver, quick=quick)
            shear, flow = map(_least_seconds, zip(*rounds, strict=True))
            ends = [run.states[-1] for run in rounds[0]]
            shear_run = rounds[0][0]
            yield {
                "scene": scene_name,
                "form": name,
                "stokes": stokes,
                "solver": solver,
                "steps": shear_run.work.steps,
                "shear_ms": 1e3 * shear,
                "flow_ms": 1e3 * flow,
                "ratio": flow / shear,
                "apart": float(np.max(np.abs(ends[1] - ends[0]))),
            }


def anisotropy(ratio: float) -> float:
    """B = (κ² - 1)/(κ² + 1) of an aspect ratio."""
    return (ratio**2 - 1) / (ratio**2 + 1)


def period(alpha: float, ratio: float) -> float:
    """Period of the symmetry axis in the planar flow of α, in inverse shear rates; inf where it aligns instead.

    It is 4π/√((1-α)² - B²(1+α)²), Jeffery's for α = 0: the flow rotates at (1-α)/2 and strains at (1+α)/2.
    """
    square = (1 - alpha) ** 2 - (anisotropy(ratio) * (1 + alpha)) ** 2
    return 4 * pi / sqrt(square) if square > 0 else inf


def orbits(quick: bool = False) -> Iterator[Record]:
    """Spheroids without inertia in planar flows: their period, how well the orbit closes, or how they align."""
    for ratio in _RATIOS[:1] if quick else _RATIOS:
        shape = Ellipsoid((1.0, 1.0, ratio))
        for alpha in _ALPHAS:
            theory = period(alpha, ratio)
            flow = Flow.planar(alpha)
            row = {"ratio": ratio, "alpha": alpha, "theory": theory}
            if theory == inf:
                scene = Scene(shape, 0.0, START, ALIGNING, flow)
                yield row | {"period": inf, "apart": _from_eigenvector(scene, ratio)}
                continue
            scene = Scene(shape, 0.0, START, _PERIODS * theory, flow)
            yield row | {"period": _measured_period(scene), "apart": _not_closed(scene, theory)}


def _run(scene: Scene, events: Sequence[Event] = ()) -> Any:
    """Solution without inertia, to `_ORBIT_TOLERANCE`."""
    return solve_scene(
        scene,
        form="jeffery",
        solver="cyrk-vern8",
        tolerance=_ORBIT_TOLERANCE,
        estimate=False,
        events=events,
    )


def _measured_period(scene: Scene) -> float:
    """The time from the first to the third passage of the axis through the plane x = 0, in either sense.

    `rotation[:, 2, 0]` is x of the third body axis, which is the symmetry axis.
    """
    crossing = Event("crossing", lambda solution: solution.rotation[:, 2, 0])
    times = _run(scene, events=[crossing]).events["crossing"].times
    return float(times[2] - times[0])


def _not_closed(scene: Scene, theory: float) -> float:
    """Largest difference of a component of the symmetry axis after a period from the one at the start."""
    end = _run(replace(scene, time=theory)).rotation[-1, 2]
    return float(np.max(np.abs(end - scene.initial_rotation[2])))


def _from_eigenvector(scene: Scene, ratio: float) -> float:
    """Angle in rad between the axis at the end and the eigenvector of O + B S that grows fastest.

    O and S are the antisymmetric and the symmetric part of the gradient A. Without inertia the axis has the
    direction of a vector q with dq/dt = (O + B S) q. It turns to the eigenvector that grows fastest. The
    angle is taken as its sine.
    """
    assert scene.flow is not None
    gradient = np.array(scene.flow.gradient)
    operator = 0.5 * (gradient - gradient.T) + anisotropy(ratio) * 0.5 * (gradient + gradient.T)
    eigen: Any = np.linalg.eig(operator)
    expected = eigen.eigenvectors[:, np.argmax(eigen.eigenvalues.real)].real
    end = _run(scene).rotation[-1, 2]
    return float(np.linalg.norm(np.cross(end, expected)))


def extension(quick: bool = False) -> Iterator[Record]:
    """Bodies in axial extension, with and without inertia: the angle in rad between their axis and where it aligns."""
    for ratio, where in _EXTENDED_RATIOS:
        for stokes in _EXTENDED_STOKES[:2] if quick else _EXTENDED_STOKES:
            scene = Scene(Ellipsoid((1.0, 1.0, ratio)), stokes, START, ALIGNING, Flow.extension())
            form = "jeffery" if stokes == 0 else "spheroid-axis"
            solution = solve_scene(scene, form=form, tolerance=_EXTENDED_TOLERANCE, estimate=False)
            # x of the third body axis, the symmetry axis: the flow stretches along x.
            along = min(1.0, abs(float(solution.rotation[-1, 2, 0])))
            angle = np.arccos(along) if where == "along" else np.arcsin(along)
            yield {"ratio": ratio, "stokes": stokes, "aligns": where, "angle": float(angle)}


def source(time: Any) -> Any:
    """The gradient of all tracks, shape (..., 3, 3), at times: it changes smoothly, at two frequencies."""
    # Sizes, frequencies (in rad per inverse shear rate) and the phase are any numbers; the trace of `wave` is 0.
    phase = np.asarray(time)[..., None, None]
    steady = np.array(Flow.planar(0.2).gradient)
    wave = np.array([[0.15, 0.05, -0.2], [0.1, -0.25, 0.15], [0.05, 0.1, 0.1]])
    return steady + np.sin(1.3 * phase + 0.2) * wave + np.cos(0.7 * phase) * wave.T


def _along(count: int, time: float) -> Scene:
    """A scene along the track through `source` at count + 1 knots, both ends included; St and shape are any."""
    times = np.linspace(0.0, time, count + 1)
    shape = Ellipsoid((1.0, 0.8, 0.5))
    return Scene(shape, 10.0, START, time, Flow.track(times, source(times)))


def orders(quick: bool = False) -> Iterator[Record]:
    """Error of L over I_max, at the end of runs along tracks, against a run in their source in long double.

    These errors are the splines'.
    """
    scene = _along(_KNOTS[0], TRACK_TIME)
    # Only the start and the end are kept: two rows.
    (reference,) = _by_long_double([scene], lambda time, _: source(time), _TRACK_STEPS, 2)
    momentum = reference.angular_momentum
    for count in _KNOTS[:3] if quick else _KNOTS:
        problem = find_form("quaternion").problem(_along(count, TRACK_TIME))
        solution = solve(problem, "taylor", _TRACK_TOLERANCE)
        observables = find_form("quaternion").observe(scene, solution.states[-1:])
        error = np.max(np.abs(observables.angular_momentum[-1] - momentum[-1]))
        unit = max(scene.ellipsoid.inertia)
        spacing = TRACK_TIME / count
        yield {"knots": count, "spacing": spacing, "error": float(error) / unit}


def knots(quick: bool = False) -> Iterator[Record]:
    """Cost of a knot, by solver: the time of a run along a track minus the time of a run in a constant flow.

    The difference is shared by the intervals between knots. One knot more, the first, costs nothing: runs
    begin there.
    """
    equations = find_form("quaternion")
    for solver in _TRACK_SOLVERS:
        for count in _LONG_TRACK_KNOTS[:1] if quick else _LONG_TRACK_KNOTS:
            scene = _along(count, LONG_TRACK_TIME)
            steady = replace(scene, flow=Flow(source(0.0)))
            pair = [equations.problem(variant) for variant in (steady, scene)]
            rounds = _in_turns(pair, solver, quick=quick)
            constant, track = map(_least_seconds, zip(*rounds, strict=True))
            constant_run, track_run = rounds[0]
            yield {
                "solver": solver,
                "knots": count,
                "steps": track_run.work.steps,
                "steps_constant": constant_run.work.steps,
                "track_ms": 1e3 * track,
                "constant_ms": 1e3 * constant,
                "knot_us": 1e6 * (track - constant) / count,
            }


def _by_long_double(
    scenes: list[Scene], gradient: Callable[[np.ndarray, int], np.ndarray], steps: int, rows: int
) -> list[Observables]:
    """Observables of scenes at equispaced times by the integration in long double."""
    shapes = [scene.ellipsoid for scene in scenes]
    inertia = np.array([shape.inertia for shape in shapes])
    bodies = Bodies(
        np.array([shape.scaled_axes for shape in shapes]),
        inertia,
        np.array([shape.resistance for shape in shapes]),
        np.array([scene.stokes for scene in scenes]),
    )
    rotation, momentum = integrate(
        bodies,
        np.array([scene.initial_rotation for scene in scenes]),
        np.array([scene.angular_velocity for scene in scenes]),
        gradient,
        np.array([scene.time for scene in scenes]),
        steps,
        rows,
    )
    # L in body axes, shape (rows, n, 3).
    inside = np.einsum("knij,knj->kni", rotation, momentum)
    energy = np.sum(inside**2 / inertia, axis=2) / 2
    return [Observables(momentum[:, i], energy[:, i], rotation[:, i]) for i in range(len(scenes))]


def random_scenes(count: int) -> list[tuple[str, Scene]]:
    """Random scenes with the form that solves each: four in steady flows, four along tracks, and so on.

    Ranges without a reason beside them are estimates.
    """
    random = np.random.default_rng(_SCENES_SEED)
    names = [name for name in _FORMS if name != "jeffery"]
    scenes = []
    for number in range(count):
        name = names[number % len(names)]
        axes = 10 ** random.uniform(*_AXIS_DECADES, 3)
        if name.startswith("spheroid"):
            axes[1] = axes[0]
        shape = Ellipsoid(tuple(axes.tolist()))
        stokes = max(shape.damping) / 10 ** random.uniform(*_RUN_DAMPING_DECADES)
        theta = random.uniform(*_RUN_THETAS)
        angles = (theta, *random.uniform(0, _FULL_TURN, 2).tolist())
        start = EulerStart(angles, tuple(random.normal(size=3).tolist()))
        time = float(random.uniform(*_RUN_TIMES)) * _RUN_TIME
        # The first four scenes of each eight, one for each form, are in a steady flow. The other four are in
        # flows that fluctuate about a steady one.
        gradients = [random_gradient(random)] * (_RUN_KNOTS + 1)
        flow = Flow(gradients[0])
        if number % (2 * len(names)) >= len(names):
            gradients = [
                gradient + _RUN_FLUCTUATION * random_gradient(random) for gradient in gradients
            ]
            flow = Flow.track(np.linspace(0.0, time, _RUN_KNOTS + 1), gradients)
        scenes.append((name, Scene(shape, float(stokes), start, time, flow)))
    return scenes


def _gradients(scenes: list[Scene]) -> Callable[[np.ndarray, int], np.ndarray]:
    """A function of times within a step, and the step: the gradients of scenes, by SciPy's splines.

    SciPy computes the coefficients in double; they are evaluated in long double.
    """
    from scipy.interpolate import CubicSpline

    # Coefficients between two knots, from the constant one on; of a steady flow that one alone.
    cubics = np.zeros((len(scenes), _RUN_KNOTS, 4, 3, 3), dtype=np.longdouble)
    for i, scene in enumerate(scenes):
        flow = scene.flow
        assert flow is not None
        if flow.varies:
            spline = CubicSpline(np.array(flow.knots), np.array(flow.gradients))
            cubics[i] = np.moveaxis(spline.c[::-1], 1, 0)
        else:
            cubics[i, :, 0] = flow.gradient
    # Times between knots, shape (n,).
    widths = np.array([scene.time for scene in scenes], dtype=np.longdouble) / _RUN_KNOTS

    def gradient(time: np.ndarray, step: int) -> np.ndarray:
        # The number of the last knot that is not after the start of the step.
        knot = step * _RUN_KNOTS // _RUN_STEPS
        since = (time - knot * widths)[:, None, None]
        c = cubics[:, knot]
        return c[:, 0] + since * (c[:, 1] + since * (c[:, 2] + since * c[:, 3]))

    return gradient


def stated(quick: bool = False) -> Iterator[Record]:
    """Errors of random runs against long double, and the upper ends that the runs state: a row for each run.

    "slow" is of L and E over I_max, "angle" of the orientation in rad; "slow_high" and "angle_high" are the
    upper ends. A run that failed has inf in all four.
    """
    named_scenes = random_scenes(_QUICK_RUNS if quick else _RUNS)
    scenes = [scene for _, scene in named_scenes]
    references = _by_long_double(scenes, _gradients(scenes), _RUN_STEPS, _RUN_ROWS)
    random = np.random.default_rng(_ERRORS_SEED)
    for reference, (name, scene) in zip(references, named_scenes, strict=True):
        requested = float(10 ** random.uniform(*_RUN_ERROR_DECADES))
        solution = solve_scene(scene, form=name, error=requested, samples=_RUN_ROWS)
        row: Record = {"form": name, "track": bool(scene.flow and scene.flow.varies)}
        row |= {"requested": requested, "status": str(solution.status)}
        if not solution.success:
            yield row | {"slow": inf, "slow_high": inf, "angle": inf, "angle_high": inf}
            continue
        slow = np.max(np.abs(solution.observables.slow - reference.slow)) / max(
            scene.ellipsoid.inertia
        )
        angle = orientation_difference(scene.ellipsoid, solution.rotation, reference.rotation)
        # A rotation of NaN alone has no angle, and counts as missed.
        row |= {"slow": float(slow), "angle": inf if angle is None else float(np.max(angle))}
        slow_error = solution.error.slow
        orientation = solution.error.orientation
        # A run that states no error has an upper end of 0, above which any error lies: it counts as missed.
        row["slow_high"] = slow_error.high if slow_error else 0.0
        yield row | {"angle_high": orientation.high if orientation else 0.0}


TABLES: dict[str, Callable[[bool], Iterator[Record]]] = {
    "fields": fields,
    "costs": costs,
    "orbits": orbits,
    "extension": extension,
    "orders": orders,
    "knots": knots,
    "stated": stated,
}


def measure_all(*, quick: bool = False, quiet: bool = False) -> dict[str, list[Record]]:
    """All tables of the page by name; with `quick` each takes less work: fewer or shorter runs, or fewer states."""
    tables = {}
    with Steps("flows", len(TABLES), "tables", quiet) as progress:
        for name, rows in TABLES.items():
            progress.detail(name)
            tables[name] = list(rows(quick))
            progress.advance()
    return tables
