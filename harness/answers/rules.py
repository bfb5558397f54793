"""Which form, which solver and which first tolerance: few rules, each with its reason."""

from math import exp, inf, isinf, pi
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.request import EPS, one_digit
from polhode.harness.references.rotations import damping_times, is_stiff
from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.form import Form
from polhode.models.scene import Scene, SlowStart
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Solver

# The best solver that is installed: of high order where accuracy sets the steps, implicit where
# stability does.
EXPLICIT = ("cyrk-vern8", "cyrk-dop853", "taylor", "dop853")
IMPLICIT = ("cyrk-radau", "cvode-bdf", "radau")
SPLITTING = ("splitting", "splitting-extended")
# The explicit solver where an eps a step would be more than this share of the error: it takes about
# as many steps as Verner's method, whose coefficients round in one direction, and errs by a tenth.
_ROUNDS_LESS = "cyrk-dop853"
_ROUNDED_SHARE = 0.1
# St from which on the torque is so small that splitting takes fewer steps than Runge-Kutta.
_SPLITTING_FROM = 300.0
# St from which on a run is averaged where that is cheaper.
_HYBRID_FROM = 1e4
# The least error that `hybrid` is tried for: at tighter ones its full segments cover the run.
_HYBRID_LEAST_ERROR = 3e-9
# Steps of a full run that cost as much as the second-order tables of a triaxial shape.
_STEPS_OF_TABLES = 600_000
# Steps of a full run that cost as much as a run of `hybrid` by a spheroid.
_STEPS_OF_SPHEROID = 60_000
# Tolerance of `hybrid` over the error that it meets with a margin.
_HYBRID_TOLERANCE = 1 / 200
# Tolerance of an averaged run over its error: its steps cost nothing.
_AVERAGED_TOLERANCE = 1e-2
# The same of triaxial shapes, where L² = 2EI₂ amplifies errors.
_AVERAGED_TOLERANCE_TRIAXIAL = 1e-3
# The shear turns a body at half its rate, in rad per unit of time.
_SHEAR = 0.5
# The tightest and the loosest first tolerance.
TIGHTEST = 1e-15
LOOSEST = 1e-2


class Pace(NamedTuple):
    """Steps that a solver takes in a rotation at the tolerance 1e-8, and the order with which they grow."""

    steps: float
    order: float

    def per_turn(self, tolerance: float) -> float:
        """Steps a rotation at a tolerance."""
        return self.steps * (1e-8 / tolerance) ** (1 / self.order)


# In the median of random scenes; a step of splitting takes a third of the time of one of Runge and
# Kutta.
_EXPLICIT_PACE = Pace(12.0, 8.0)
_SPLITTING_PACE = Pace(2.0, 6.0)


class Growth(NamedTuple):
    """Error over tolerance of a run in four of five scenes: a first amount, and a power of the rotations."""

    amount: float
    power: float

    def after(self, turns: float) -> float:
        """Error over tolerance after `turns` rotations."""
        return self.amount * (1 + turns) ** self.power


# Explicit, splitting and implicit methods: measured on random scenes at the tolerance 1e-8.
_GROWTH = {
    ("explicit", "slow"): Growth(6.0, 0.25),
    ("explicit", "orientation"): Growth(1.5, 1.5),
    ("splitting", "slow"): Growth(0.15, 0.1),
    ("splitting", "orientation"): Growth(0.3, 0.85),
    ("implicit", "slow"): Growth(2.0, 0.0),
    ("implicit", "orientation"): Growth(4.0, 0.0),
}


class Method(NamedTuple):
    """A form and a solver."""

    form: Form
    solver: Solver


def rotations(scene: Scene) -> float:
    """Estimate the rotations of a run before it: the start's own spin until damping ends it, then the flow's."""
    rate = _SHEAR if scene.flow is None else scene.flow.rate
    if isinstance(scene.start, SlowStart):
        return rate * scene.time / (2 * pi)
    speed = float(np.linalg.norm(scene.angular_velocity))
    damped = damping_times(scene)
    lasting = (1 - exp(-damped)) / damped if damped > 0 else 1.0
    return scene.time * (rate + max(0.0, speed - rate) * lasting) / (2 * pi)


def stiff(scene: Scene) -> bool:
    """Whether stability, not accuracy, sets the steps of an explicit method."""
    return is_stiff(scene, rotations(scene))


def simplest(scene: Scene) -> str:
    """The full form of the fewest equations that takes a scene."""
    name = "euler-top" if isinf(scene.stokes) else full_form(scene)
    if name in ("quaternion", "spheroid-axis") and find_form("tumbling").takes(scene):
        name = "tumbling"
    find_form(name).check(scene)
    return name


def full_method(scene: Scene) -> Method:
    """The method that follows the full equations of a scene."""
    form = find_form(simplest(scene))
    return Method(form, full_solver(scene, form))


def full_solver(scene: Scene, form: Form) -> Solver:
    """The solver for a form: exact where there is a closed form, else implicit where the scene is stiff."""
    preferred = IMPLICIT if stiff(scene) and not form.averaged else EXPLICIT
    first = find_solver(preferred[0])
    if 0 < scene.stokes < inf and first.available:
        # There is no closed form, and every form has explicit equations.
        return first
    problem = form.problem(scene)
    if problem.closed_form is not None:
        return find_solver("exact")
    for name in (*preferred, *SOLVERS):
        solver = find_solver(name)
        if solver.available and solver.takes(problem):
            return solver
    return find_solver(preferred[0])


def method_for(scene: Scene, form: Form | None, solver: Solver | None) -> Method:
    """Fill in the form and the solver that the user left open."""
    if form:
        return Method(form, solver or full_solver(scene, form))
    if isinstance(scene.start, SlowStart):
        # No other form takes a start without orientation.
        form = find_form(averaged_form(scene))
        return Method(form, solver or full_solver(scene, form))
    if solver:
        return Method(_form_for(scene, solver), solver)
    return full_method(scene)


def methods_for(scene: Scene, error: float, want: str) -> list[Method]:
    """Methods to try in turn where the user left form and solver open, the cheapest one first."""
    methods = []
    if isinstance(scene.start, SlowStart):
        return [method_for(scene, None, None)]
    if _hybrid_pays(scene, error, want):
        # Averaged segments go at steps of their own: stability is no question there.
        methods.append(Method(find_form("hybrid"), first_available(EXPLICIT)))
    if splits(scene):
        axis = find_form("spheroid-axis")
        solvers = [find_solver(name) for name in SPLITTING]
        methods += [Method(axis, solver) for solver in solvers if solver.available]
    if not splits(scene) or not methods:
        methods.append(_rounding_less(scene, full_method(scene), error, want))
    return methods


def _rounding_less(scene: Scene, method: Method, error: float, want: str) -> Method:
    """The method, or where rounding of its steps would count one that rounds less."""
    alternative = find_solver(_ROUNDS_LESS)
    if method.solver.name != EXPLICIT[0] or not alternative.available:
        return method
    steps = steps_of(scene, method, first_tolerance(scene, method, error, want))
    rounding = EPS * steps * (1 + rotations(scene) if want == "orientation" else 1)
    return method._replace(solver=alternative) if rounding > _ROUNDED_SHARE * error else method


def _form_for(scene: Scene, solver: Solver) -> Form:
    """The simplest full form that a solver takes."""
    names = [simplest(scene), full_form(scene), "quaternion", "jeffery"]
    for name in names:
        form = find_form(name)
        if form.takes(scene) and solver.takes(form.problem(scene)):
            return form
    return find_form(names[0])


def first_available(names: tuple[str, ...]) -> Solver:
    """The first solver that is installed; the first of all where none is."""
    return next(
        (candidate for candidate in map(find_solver, names) if candidate.available),
        find_solver(names[0]),
    )


def splits(scene: Scene) -> bool:
    """Whether splitting takes fewer steps than Runge-Kutta: a spheroid at large St in a constant flow."""
    spheroid = scene.ellipsoid.symmetry_axis is not None
    if scene.flow is not None and scene.flow.varies:
        return False
    return spheroid and _SPLITTING_FROM <= scene.stokes < inf


def _hybrid_pays(scene: Scene, error: float, want: str) -> bool:
    """Whether a run by `hybrid`, and the tables of a shape, cost less than a full run."""
    if want != "slow" or error < _HYBRID_LEAST_ERROR or not _HYBRID_FROM <= scene.stokes < inf:
        return False
    if not find_form("hybrid").takes(scene):
        return False
    turns = rotations(scene)
    kind = "explicit"
    pace = _EXPLICIT_PACE
    most = _STEPS_OF_TABLES
    if splits(scene):
        kind = "splitting"
        pace = _SPLITTING_PACE
        most = _STEPS_OF_SPHEROID
    tolerance = error / _GROWTH[kind, "slow"].after(turns)
    return pace.per_turn(tolerance) * turns > most


def first_tolerance(scene: Scene, method: Method, error: float, want: str) -> float:
    """The tolerance at which four of five runs meet an error."""
    if method.form.name == "hybrid":
        return one_digit(_within(_HYBRID_TOLERANCE * error))
    if method.form.averaged:
        crosses = scene.ellipsoid.kind == "triaxial"
        share = _AVERAGED_TOLERANCE_TRIAXIAL if crosses else _AVERAGED_TOLERANCE
        return one_digit(_within(share * error))
    if method.solver.many_periods:
        kind = "splitting"
    elif method.solver.implicit:
        kind = "implicit"
    else:
        kind = "explicit"
    return one_digit(_within(error / _GROWTH[kind, want].after(rotations(scene))))


def _within(tolerance: float) -> float:
    return min(LOOSEST, max(TIGHTEST, tolerance))


def steps_of(scene: Scene, method: Method, tolerance: float) -> float:
    """Approximate steps of a run, in explicit ones; 0 where they do not follow the rotations."""
    if method.form.averaged or method.form.name == "hybrid" or method.solver.closed_form:
        return 0.0
    turns = rotations(scene)
    if method.solver.many_periods:
        return _SPLITTING_PACE.per_turn(tolerance) * turns
    return _EXPLICIT_PACE.per_turn(tolerance) * turns
