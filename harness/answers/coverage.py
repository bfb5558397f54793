"""What stated errors are worth: random scenes of every kind of confirmation, held against references.

Each group draws scenes that its solvers are for, runs one of them at a random tolerance or until a
random error is met, and compares the whole solution with a reference at `SAMPLES` times. One set of
runs fits the factors (`fit`), another counts how many statements hold (`summary`).
"""

from collections.abc import Callable
from dataclasses import replace
from math import acos, inf, pi
from time import perf_counter
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.confirmed import Answer, confirm, meet
from polhode.harness.answers.rules import Method, full_method, rotations, stiff
from polhode.harness.answers.runs import Runner
from polhode.harness.common.store import Record
from polhode.harness.references.errors import errors
from polhode.harness.references.extended import ReferenceFailedError, extended_run
from polhode.harness.references.reference import reference
from polhode.models.catalogue import form as find_form, full_form, reference_form
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import solver as find_solver

# Times at which a solution is compared with its reference.
SAMPLES = 2001
# Seconds that a reference may take.
REFERENCE_SECONDS = 60.0
# Decades of the tolerances and of the errors drawn.
TOLERANCES = (-13.0, -3.0)
ERRORS = (-10.0, -3.0)
# Tolerance of a reference in long double that serves a fit.
FIT_TOLERANCE = 1e-19
# Rotations of a scene, at most: references of more take minutes.
MAX_TURNS = 5_000.0
# Rotations from which on solvers and forms that average do so.
LEAST_AVERAGED_TURNS = 1_200.0
# Share of the runs of a fit above the upper end, and below the lower one.
FITTED_BEYOND = 0.01


class Group(NamedTuple):
    """Runs of one sort: how scenes are drawn, by which forms and solvers, and whether to an error."""

    scenes: str
    to_error: bool
    methods: tuple[str, ...]  # "form solver"; the form "full" is the usual one of the scene


GROUPS = {
    "explicit": Group("ordinary", True, ("full cyrk-vern8", "full cyrk-dop853", "full cyrk-vern7")),
    "explicit at a tolerance": Group(
        "ordinary", False, ("full cyrk-vern8", "full cyrk-dop853", "full cyrk-vern7")
    ),
    "other solvers": Group(
        "ordinary",
        False,
        (
            "full taylor",
            "full cyrk-tsit5",
            "full cyrk-lsoda",
            "full cvode-adams",
            "full cvode-bdf",
            "full cyrk-radau",
            "euler-angles cyrk-vern8",
            "spheroid-angles cyrk-dop853",
        ),
    ),
    "stiff": Group("stiff", True, ("full cyrk-radau",)),
    "stiff at a tolerance": Group(
        "stiff",
        False,
        ("full cyrk-radau", "full cyrk-lsoda", "full cyrk-bdf", "full cvode-bdf", "full ida"),
    ),
    "splitting": Group("spheroids", True, ("spheroid-axis splitting",)),
    "splitting at a tolerance": Group("spheroids", False, ("spheroid-axis splitting",)),
    "splitting-extended": Group("spheroids", True, ("spheroid-axis splitting-extended",)),
    "splitting-extended at a tolerance": Group(
        "spheroids", False, ("spheroid-axis splitting-extended",)
    ),
    "stroboscopic": Group("many turns", True, ("spheroid-axis stroboscopic",)),
    "stroboscopic at a tolerance": Group("many turns", False, ("spheroid-axis stroboscopic",)),
    "hybrid": Group("fast", True, ("hybrid cyrk-vern8",)),
    "hybrid at a tolerance": Group(
        "fast",
        False,
        ("hybrid cyrk-vern8", "hybrid cyrk-dop853", "hybrid taylor", "hybrid cyrk-radau"),
    ),
    "first order": Group("slow", False, ("averaged taylor", "averaged cyrk-vern8")),
    "second order": Group("fast", False, ("averaged-second-order cyrk-vern8",)),
    "closed form": Group("exact", False, ("full exact",)),
}


class Case(NamedTuple):
    """One run to make: a scene, a method, and a tolerance or an error of what is wanted."""

    scene: Scene
    method: Method
    tolerance: float
    error: float
    want: str


def drawn(group: str, seed: int, index: int) -> Case:
    """A random case of a group; each has a generator of its own."""
    sort = GROUPS[group]
    names = sorted(GROUPS)
    random = np.random.default_rng((seed, names.index(group), index))
    scene = _SCENES[sort.scenes](random)
    while not _is_fit(scene, sort.scenes):
        scene = _SCENES[sort.scenes](random)
    form, solver = random.choice(sort.methods).split()
    if form == "full":
        form = full_method(scene).form.name
    if form == "averaged" and scene.ellipsoid.kind != "triaxial":
        form = "averaged-spheroid"
    tolerance = float(f"{10 ** random.uniform(*TOLERANCES):.0e}")
    error = float(f"{10 ** random.uniform(*ERRORS):.1e}")
    form_averages = sort.scenes in ("slow", "fast")
    want = "orientation" if random.random() < 0.5 and not form_averages else "slow"
    return Case(scene, Method(find_form(form), find_solver(solver)), tolerance, error, want)


def _is_fit(scene: Scene, sort: str) -> bool:
    """Whether a scene is one of its sort, and not too long for a reference."""
    turns = rotations(scene)
    if sort in ("many turns", "slow", "fast") and turns < LEAST_AVERAGED_TURNS / 2:
        return False
    return turns <= 1.01 * MAX_TURNS and (sort == "stiff") == stiff(scene)


def measured(group: str, seed: int, index: int, certified: bool = True) -> Record:
    """A run with its stated and its true errors; a reason alone where it cannot be judged."""
    case = drawn(group, seed, index)
    head = {"group": group, "index": index, "form": case.method.form.name}
    head["solver"] = case.method.solver.name
    try:
        answer = _answer(case, GROUPS[group].to_error)
        if not answer.solution.success:
            return head | {"left_out": str(answer.solution.status)}
        true, uncertainty = _reference(case.scene, certified)
    except (ReferenceFailedError, ValueError) as reason:
        return head | {"left_out": str(reason)}
    form = answer.method.form
    off = errors(case.scene.ellipsoid, form.observe(case.scene, answer.solution.states), true)
    stated = answer.error
    row = head | {
        "stokes": case.scene.stokes,
        "kind": stated.kind,
        "family": stated.family,
        "turns": rotations(case.scene),
        "tolerance": answer.tolerance,
        "error": case.error if GROUPS[group].to_error else None,
        "want": case.want,
        "note": stated.note,
        "seconds": answer.solution.seconds,
        "confirmation_seconds": stated.seconds,
    }
    for want in ("slow", "orientation"):
        interval = stated.wanted(want)
        row[want] = getattr(off, want)
        row[f"{want}_uncertainty"] = uncertainty[want]
        row[f"{want}_stated"] = interval and [interval.low, interval.predicted, interval.high]
        row[f"{want}_apart"] = stated.apart.get(want)
    return row


def _answer(case: Case, to_error: bool) -> Answer:
    runner = Runner(case.scene, np.linspace(0.0, case.scene.time, SAMPLES))
    if to_error:
        return meet(runner, [case.method], case.error, case.want)
    return confirm(runner, case.method, case.tolerance)


def _reference(scene: Scene, certified: bool) -> tuple[Observables, dict[str, float]]:
    """Observables and their uncertainties, certified or from one run in long double."""
    if certified:
        known = reference(scene, reference_form(scene), SAMPLES, REFERENCE_SECONDS)
        if known.meaningful < SAMPLES:
            raise ReferenceFailedError("the motion is chaotic")
        angle = known.orientation_uncertainty or 0.0
        return known.observables, {"slow": known.slow_uncertainty, "orientation": angle}
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    times = np.linspace(0.0, problem.end, SAMPLES)
    deadline = perf_counter() + REFERENCE_SECONDS
    states = extended_run(problem, times, "long double", FIT_TOLERANCE, deadline)
    found = form.observe(scene, states)
    parts = (each.astype(float) for each in vars(found).values())
    return Observables(*parts), {"slow": 0.0, "orientation": 0.0}


def _axes(random: np.random.Generator, spheroid: bool) -> tuple[float, float, float]:
    middle, short = sorted(10 ** random.uniform(-1.0, -0.02, 2), reverse=True)
    if not spheroid:
        axes = (1.0, middle, short)
    elif random.random() < 0.5:
        axes = (1.0, short, short)
    else:
        axes = (1.0, 1.0, short)
    a, b, c = (float(axes[i]) for i in random.permutation(3))
    return a, b, c


def _start(random: np.random.Generator) -> BodyStart:
    angles = (acos(random.uniform(-1, 1)), random.uniform(0, 2 * pi), random.uniform(0, 2 * pi))
    size = 10 ** random.uniform(-1.0, 1.0) if random.random() < 0.4 else 1.0
    x, y, z = (size * random.normal(size=3)).tolist()
    return BodyStart(EulerStart(angles).quaternion, (x, y, z))


def _ordinary(random: np.random.Generator) -> Scene:
    """Any shape and St, runs of up to thousands of rotations."""
    stokes = float(10 ** random.uniform(-1.0, 5.0))
    time = stokes * 10 ** random.uniform(-1.5, 0.3) if stokes > 20 else 10 ** random.uniform(0.5, 2)
    return Scene(
        Ellipsoid(_axes(random, random.random() < 0.4)), stokes, _start(random), float(time)
    )


def _stiff(random: np.random.Generator) -> Scene:
    """Damping so fast that stability holds explicit methods back."""
    ellipsoid, start = Ellipsoid(_axes(random, random.random() < 0.4)), _start(random)
    stokes = float(10 ** random.uniform(-4.0, -1.0))
    damping_times = 10 ** random.uniform(4.4, 5.3)
    return Scene(ellipsoid, stokes, start, float(damping_times * stokes / max(ellipsoid.damping)))


def _spheroids(random: np.random.Generator) -> Scene:
    """Spheroids at large St, up to thousands of rotations."""
    stokes = float(10 ** random.uniform(1.5, 6.0))
    time = min(stokes * 10 ** random.uniform(-2.0, 0.3), 10 ** random.uniform(2.0, 4.5))
    return Scene(Ellipsoid(_axes(random, True)), stokes, _start(random), float(time))


def _turning(random: np.random.Generator, spheroid: bool) -> Scene:
    """Large St and thousands of rotations, where averaging applies."""
    ellipsoid, start = Ellipsoid(_axes(random, spheroid)), _start(random)
    stokes = float(10 ** random.uniform(3.0, 6.0))
    turns = 10 ** random.uniform(*np.log10([LEAST_AVERAGED_TURNS, MAX_TURNS]))
    whole = Scene(ellipsoid, stokes, start, 2 * stokes)
    return replace(whole, time=min(whole.time, whole.time * turns / rotations(whole)))


def _fast(random: np.random.Generator) -> Scene:
    """Damping so slow beside the rotation that averaging to second order holds almost everywhere."""
    scene = _turning(random, random.random() < 0.3)
    return replace(scene, stokes=float(10 ** random.uniform(5.0, 7.5)))


def _exact(random: np.random.Generator) -> Scene:
    """No torque, or a spheroid without inertia: closed forms."""
    spheroid = random.random() < 0.5
    ellipsoid, start = Ellipsoid(_axes(random, spheroid)), _start(random)
    time = float(10 ** random.uniform(0.5, 4.0))
    return Scene(ellipsoid, 0.0 if spheroid else inf, start, time)


def _many_turns(random: np.random.Generator) -> Scene:
    """Spheroids of thousands of rotations."""
    return _turning(random, True)


def _slow(random: np.random.Generator) -> Scene:
    """Any shape, thousands of rotations."""
    return _turning(random, random.random() < 0.3)


_SCENES: dict[str, Callable[[np.random.Generator], Scene]] = {
    "ordinary": _ordinary,
    "stiff": _stiff,
    "spheroids": _spheroids,
    "many turns": _many_turns,
    "slow": _slow,
    "fast": _fast,
    "exact": _exact,
}
