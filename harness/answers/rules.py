"""Which form, which solver and which first tolerance: few rules, each with its reason."""

from functools import lru_cache
from math import exp, floor, inf, isinf, log10, pi
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.fitted import factors, growth, steps_per_turn
from polhode.harness.answers.request import EPS, one_digit
from polhode.harness.references.rotations import damping_times, is_stiff
from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.form import Form
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE
from polhode.models.scene import Scene, SlowStart
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Solver

# A factor of two in a number called an estimate changes which method or tolerance is tried first, or how soon a
# search ends, and so the time of an answer. Its error is confirmed all the same.

# The best solver that is installed: of high order where accuracy sets the steps, implicit where
# stability does.
EXPLICIT = ("cyrk-vern8", "cyrk-dop853", "taylor", "dop853")
IMPLICIT = ("cyrk-radau", "cvode-bdf", "radau")
SPLITTING = ("splitting", "splitting-extended")
# The explicit solver where an eps a step would be more than this share of the error: it takes about
# as many steps as Verner's method, whose coefficients round in one direction, and errs by a tenth.
# The share is an estimate.
_ROUNDS_LESS = "cyrk-dop853"
_ROUNDED_SHARE = 0.1
# St from which on the torque is so small that splitting takes fewer steps than Runge-Kutta; an estimate.
_SPLITTING_FROM = 300.0
# The least error times St² that `hybrid` is tried for: below it full segments cover the run. In ten
# timed runs `hybrid` took 0.02 to 0.2 times plain practice in the six above, 1.0 to 3.2 in the four below.
HYBRID_LEAST_ERROR = 2e5
# Steps of a full run that cost as much as the second-order tables of a triaxial shape; an estimate.
STEPS_OF_TABLES = 600_000
# Steps of a full run at `PACED_TOLERANCE` from which on tables of a triaxial shape are made to confirm an averaged
# run: fewer than above, since tables are kept and more runs of the shape may follow. The number is an estimate.
TABLED_FROM = 50_000
# Steps of a full run that cost as much as to look ahead along a run and to average it, tables not
# counted: of 42 random spheroids with more, `hybrid` took 0.01 to 0.75 times as long as splitting.
AVERAGED_FROM = 2_000
# Tolerance of an averaged run over its error: its steps cost nothing, and L² = 2EI₂ amplifies errors.
# I₂ is the middle moment of inertia; the motion without torque has its separatrix there. An estimate.
_AVERAGED_TOLERANCE = 1e-3
# The shear turns a body at half its rate, in rad per unit of time.
_SHEAR = 0.5
# Tolerance of a run whose own error counts for nothing beside the error that it shows. An estimate.
SHARP = 1e-12
# The tightest and the loosest tolerance that is tried: near rounding, and one that still sets the steps. Both are
# estimates.
TIGHTEST = 1e-15
LOOSEST = 1e-2
# Added to a logarithm before it is floored, so that -5 stays -5 where rounding makes it a little less.
_FLOOR_SLACK = 1e-9


class Method(NamedTuple):
    """A form and a solver."""

    form: Form
    solver: Solver


def flow_rate(scene: Scene) -> float:
    """The rate at which a scene's flow turns a body without inertia, in rad per unit of time; an estimate."""
    return _SHEAR if scene.flow is None else scene.flow.rate


# The limit bounds memory alone.
@lru_cache(maxsize=1000)
def rotations(scene: Scene) -> float:
    """Estimate the rotations of a run before it: the start's own spin until damping ends it, then the flow's.

    The spin is taken to fall from its start ω₀ to the flow's rate as rate + (ω₀ - rate) exp(-S t/T). S is the
    damping times in the run's time T: in the mean over the run the exponential is (1 - exp(-S))/S.
    `references.rotations` counts along the motion instead, and takes milliseconds to tenths of a second.
    """
    rate = flow_rate(scene)
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
    """The method of a form and a solver; what is None the user left open, and rules fill in."""
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
    """Methods to try in turn where the user left form and solver open, the cheapest one first.

    The error is of L and E over I_max, or of the orientation in rad, as `want` says.
    """
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
        methods.append(rounding_less(scene, full_method(scene), error, want))
    return methods


def rounding_less(scene: Scene, method: Method, error: float, want: str) -> Method:
    """The method, or where rounding of its steps would count one that rounds less."""
    alternative = find_solver(_ROUNDS_LESS)
    if method.solver.name != EXPLICIT[0] or not alternative.available:
        return method
    steps = steps_of(scene, method, first_tolerance(scene, method, error, want))
    # The phase adds up what rounding makes of L and E.
    growth_of_phase = 1 + rotations(scene) if want == "orientation" else 1
    rounding = EPS * steps * growth_of_phase
    return method._replace(solver=alternative) if rounding > _ROUNDED_SHARE * error else method


def _form_for(scene: Scene, solver: Solver) -> Form:
    """The simplest full form that a solver takes; the simplest of all if it takes none, which is refused later."""
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
    # A product may overflow to infinity; a power would raise.
    if want != "slow" or isinf(scene.stokes):
        return False
    if error * scene.stokes * scene.stokes < HYBRID_LEAST_ERROR:
        return False
    if not find_form("hybrid").takes(scene):
        return False
    method = cheapest_full(scene)
    most = AVERAGED_FROM if splits(scene) else STEPS_OF_TABLES
    return steps_of(scene, method, first_tolerance(scene, method, error, want)) > most


def cheapest_full(scene: Scene) -> Method:
    """The full method of the fewest steps."""
    if splits(scene):
        return Method(find_form("spheroid-axis"), find_solver(SPLITTING[0]))
    return full_method(scene)


def first_tolerance(scene: Scene, method: Method, error: float, want: str) -> float:
    """The tolerance at which four of five runs meet an error; within [`TIGHTEST`, `LOOSEST`].

    `fitted.Growth` was fitted so. For `hybrid` the median of `fitted.Factors` stands in, so about half of
    the runs meet it. That of an averaged form is a fixed share of the error, since the tolerance does not
    set its error.
    """
    if method.form.name == "hybrid":
        of_kind = factors()["estimate"][hybrid_family(scene)]["slow"]
        tolerance = error / ERROR_PER_TOLERANCE / of_kind.middle
    elif method.form.averaged:
        tolerance = _AVERAGED_TOLERANCE * error
    else:
        family = "implicit" if method.solver.implicit else _family_of_steps(method)
        tolerance = error / growth(family, want).after(rotations(scene))
    return one_digit(min(LOOSEST, max(TIGHTEST, tolerance)))


def rounded(method: Method, tolerance: float) -> float:
    """The tolerance in one digit, within [`TIGHTEST`, `LOOSEST`]; a power of ten where each one is compiled for."""
    tolerance = min(LOOSEST, max(TIGHTEST, tolerance))
    if not method.solver.order_by_tolerance:
        return one_digit(tolerance)
    return max(TIGHTEST, float(f"1e{floor(log10(tolerance) + _FLOOR_SLACK)}"))


def hybrid_family(scene: Scene) -> str:
    """The family of runs by `hybrid`: its estimates of angles are closer for triaxial bodies."""
    return "hybrid" if scene.ellipsoid.kind == "triaxial" else "hybrid, spheroid"


def steps_of(scene: Scene, method: Method, tolerance: float) -> float:
    """Approximate steps of a run; 0 where they do not follow the rotations: averaged and closed forms, `hybrid`.

    They are counted as steps of the usual explicit solver, also for implicit ones. Solvers of
    `many_periods` count steps of splitting.
    """
    if method.form.averaged or method.form.name == "hybrid" or method.solver.closed_form:
        return 0.0
    return steps_per_turn(_family_of_steps(method)).at(tolerance) * rotations(scene)


def _family_of_steps(method: Method) -> str:
    """The family by whose usual solver a method's steps are counted (`fitted.steps_per_turn`)."""
    return "splitting" if method.solver.many_periods else "explicit"


def is_ours(thing: Form | Solver) -> bool:
    """Whether it comes with this package, so that tests hold what it claims."""
    return type(thing).__module__.startswith("polhode.")


def is_efficient(solver: Solver) -> bool:
    """Whether a solver is machine code of high order whose errors follow its tolerance."""
    compiled = is_ours(solver) and solver.backends == ("compiled",)
    return compiled and not (solver.implicit or solver.low_order or solver.order_by_tolerance)
