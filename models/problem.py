"""An initial value problem: what a form makes of a scene, and all that a solver needs to know."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from polhode.models.former import Former, former_object, takes_former
from polhode.models.mass import in_rows, is_singular, mass_of, with_time
from polhode.models.operations import Field, Operations
from polhode.models.own_function import OwnField, own_field

Floats = tuple[float, ...]
Factory = Callable[[Operations], Field]
Invariant = Callable[[np.ndarray], np.ndarray]

# Names of version 0.1, understood in 0.2 too.
_FORMER = {"Piece": "Segment", "Course": "NextSegment", "Segments": "ParameterTable"}

# Tolerance below which rounding makes the error, not the tolerance: in trials of `hybrid` tighter ones
# gained nothing.
ROUNDING = 1e-13


@dataclass(frozen=True)
class MassForm:
    """The same problem with its masses kept: ``mass * y' = field(y, parameters)``.

    Rows of mass zero are algebraic, so that the form stays valid where the explicit one does not
    (St = 0).
    """

    # The diagonal of the mass matrix, or its rows.
    mass: Floats | tuple[Floats, ...]
    parameters: Floats  # what the field receives as ``p`` in this form


@dataclass(frozen=True)
class Part:
    """One part of a vector field whose flow over a time h, which may be negative, is known in closed form."""

    # ``constants(p, h, ops) -> tuple``, over generic numbers: what the flow needs to know besides
    # the state. `ops` has `expm1` besides what fields may use; by default over floats.
    constants: Callable[..., tuple[Any, ...]]
    # The flow's factory, like a vector field's: ``flow(ops) -> advance(y, constants) -> tuple``.
    flow: Factory


@dataclass(frozen=True)
class Parts:
    """A field as the sum of a fast rotation and a slow rest, for solvers that know that the rest is small."""

    # The rotation: every solution of it is periodic in its angle, with period 2π.
    fast: Part
    # All else.
    slow: Part
    # (ops)(y, p): the rate of the angle, constant along the fast flow.
    rate: Callable[[Operations], Callable[[Any, Any], Any]]
    # (p): the slow part's largest rate of relaxation; 0 where the slow part does nothing.
    strength: Callable[[Sequence[float]], float]
    # (p): the least rate at which the averaged motion forgets its start, that is at which its slowest
    # disturbance decays; an estimate serves. It may be below every rate of the slow part alone.
    # Solvers divide by it where `strength` is positive, and do not use it where that is 0.
    forgetting: Callable[[Sequence[float]], float]
    # Angle, in rad, up to which `fast` is exact to rounding.
    reach: float
    # The first of the components that the fast flow changes, and the one behind the last.
    moving: tuple[int, int]
    # (y), over generic numbers: what the fast flow leaves alone.
    slow_quantities: Callable[[Any], tuple[Any, ...]]
    # (ops)(y, fast_constants, slow_constants, gains): the fast flow and the slow one behind it, where
    # they take less time together. It returns the whole state, d components. `gains`, if given, has
    # length moving[0]: what the components before the moving ones have gained, in y, since the start
    # of the solver's step. Then the first moving[0] components returned are the gains at the end of
    # the flows, in place of the components themselves, so that small changes keep their digits.
    both: Callable[[Operations], Callable[..., Sequence[Any]]] | None = None
    # (y): a mean of states that are close to each other, brought back, to second order, to where
    # solutions lie. Without it no means are taken; with it `both` must be given.
    restored: Callable[[Any], Sequence[Any]] | None = None


@dataclass(frozen=True, eq=False)
class ParameterTable:
    """Parameters of a field of time that change at given times: how a table in time is read.

    From each time to the next the last k parameters of both forms have one row of values. Before
    the first time the first row holds, and after the last time the last row.
    """

    times: np.ndarray  # shape (n + 1,), increasing, on the clock that is the state's last component
    values: np.ndarray  # shape (n, k)


@dataclass(frozen=True)
class Segment:
    """One segment of a run: a problem of its own, from where the run stands to a time of the run.

    Who makes the segment sets `problem.start` to the run's state, in the problem's own components:
    the run takes it as it is. Only the run's problem itself, between requested times, goes on from
    the run's state whatever its start. The segment's clock is the run's, in the problem's own unit
    of time (`Problem.time_unit`): it does not begin at 0 again.
    """

    problem: "Problem"
    # In the run's time. It ends the segment, or the run's end does if that comes first; `problem.end`
    # does not.
    end: float
    # ``states(own) -> run's``, shapes (n, d) each: states in the problem's own components as states
    # of the run, where these differ. The way back is needed for the start alone, which the maker
    # of the segment knows.
    states: Callable[[np.ndarray], np.ndarray] | None = None
    reason: str = ""  # why this problem here, in words
    # Expected contribution to the run's largest error of L and E, over I_max.
    error: float = 0.0
    angle: float = 0.0  # the same of the orientation, in rad
    tolerance: float | None = None  # of the solver here, where it is not that of the whole run
    then: "NextSegment | None" = None  # what gives the segments after it, where that is another one
    averaged: bool = False  # whether its equations are averaged ones


# (time, state, tolerance): where the run stands, in its own time and components, and the tolerance of
# the whole run.
NextSegment = Callable[[float, np.ndarray, float], Segment]


@takes_former(course="next_segment", segments="parameter_table")
@dataclass(frozen=True)
class Problem:
    """An autonomous initial value problem ``y' = field(y, p)``, ``y(0) = start``, on ``0 <= t <= end``.

    If rates depend on time, the time is the last component of the state (`timed`). The exception
    is a user's function that runs as plain Python (`plain`): it may depend on time, and its field
    gives the rates at the start's time alone. Solvers that take it call it with the time, by
    `OwnField.rates`.

    Parameters
    ----------
    name : str
        The form (or test problem) it comes from.
    field : callable
        The vector field's factory: ``field(ops) -> rhs(y, p) -> tuple``. A function of a module, so
        that it pickles and compiled versions can be cached under it.
    start : tuple of float, length d
        Initial state.
    end : float
        End of the run in the problem's own time.
    parameters : tuple of float, optional
        What the field receives as ``p``; None where only `mass_form` exists (St = 0).
    mass_form : MassForm, optional
        The implicit form; the explicit one with unit masses if absent.
    closed_form : callable, optional
        ``closed_form(times) -> states`` of shapes (n,) and (n, d), where the solution is known.
    periodic : tuple of int
        Components that are angles of period 2π; solvers keep them wrapped between segments of a long
        run.
    invariant : callable, optional
        ``invariant(states) -> (n,)``, a dimensionless quantity that the exact solution keeps at
        zero.
    least_steps : int
        A run of fewer steps cannot be right, whatever the library claims.
    time_unit : float
        One unit of the problem's time in units of the inverse shear rate (St for averaged forms).
    parts : Parts, optional
        The field as the sum of two parts whose flows are known.
    next_segment : callable, optional
        ``next_segment(time, state, tolerance) -> Segment``: how to go on from a state of the run,
        which then has several segments; `field` is the exact one of these. Without it a run is
        one segment.
    parameter_table : ParameterTable, optional
        How the last parameters change on the way; solvers take steps that end there.
    """

    name: str
    field: Factory
    start: Floats
    end: float
    parameters: Floats | None = ()
    mass_form: MassForm | None = None
    closed_form: Callable[[np.ndarray], np.ndarray] | None = None
    periodic: tuple[int, ...] = ()
    invariant: Invariant | None = None
    least_steps: int = 1
    time_unit: float = 1.0
    parts: Parts | None = None
    next_segment: NextSegment | None = None
    parameter_table: ParameterTable | None = None

    course = Former("next_segment")
    segments = Former("parameter_table")

    @classmethod
    def from_function(
        cls,
        f: Callable[..., Any],
        y0: Sequence[float],
        t_end: float,
        parameters: Sequence[float] = (),
        *,
        name: str = "",
        t_start: float = 0.0,
        jacobian: Any = None,
        jac_sparsity: Any = None,
        lband: int | None = None,
        uband: int | None = None,
        mass: Any = None,
    ) -> "Problem":
        """The problem of a right-hand side as SciPy's `solve_ivp` takes it, ``f(t, y, *parameters)``.

        Parameters
        ----------
        f : callable
            Returns the rates, one per component. It is compiled if it uses arithmetic and NumPy's
            functions alone; time, if it uses that, then becomes one more component of the state,
            the last one. Any other function runs as plain Python, by the solvers that can call
            Python.
        y0 : sequence of float
        t_end : float
            It may lie before `t_start`.
        parameters : sequence of float, optional
            Numbers that may change without another compilation.
        name : str, optional
            By default the function's.
        t_start : float, optional
            Time at the start; the problem's own time begins at 0 and goes forward.
        jacobian : callable or matrix, optional
            ``jacobian(t, y, *parameters)``, shape (d, d), an array or a sparse matrix. SciPy's and
            SUNDIALS' implicit methods use it.
        jac_sparsity : array or sparse matrix, optional
            Pattern of the Jacobian, zero where that is.
        lband, uband : int, optional
            Diagonals of the Jacobian below and above the main one.
        mass : array or sparse matrix, optional
            M in ``M y' = f(t, y)``: its diagonal, shape (d,), or a matrix, shape (d, d). If it is
            singular, some equations are algebraic, and `ida` alone takes the problem; the start is
            made consistent.

        Raises
        ------
        ValueError
            In one line, what is wrong with f or the numbers, and what was expected.
        """
        structure = jacobian, jac_sparsity, lband, uband
        masses = mass_of(mass, np.size(y0)) if mass is not None else None
        start, field = own_field(f, y0, (t_start, t_end), parameters, structure, masses)
        name = name or getattr(f, "__name__", "f")
        duration = abs(float(t_end - t_start))
        numbers = tuple(map(float, parameters))
        if masses is None or not is_singular(masses):
            return cls(name, field, start, duration, numbers)
        if field.timed:
            masses = with_time(masses)
        return cls(name, field, start, duration, None, MassForm(in_rows(masses), numbers))

    @property
    def timed(self) -> bool:
        """Whether the state's last component is the time."""
        return bool(getattr(self.field, "timed", False))

    def continued(self, elapsed: float, state: Floats, duration: float) -> "Problem":
        """The problem that goes on from a state of a run, for some time.

        `elapsed` is the run's time at the state, and the new problem's time begins at 0 there; a
        time in the state goes on. With a user's function the new run begins before
        `OwnField.t_end` and does not go beyond it, where the field's time may stand still.

        All else stays as in the whole run. `closed_form` and `next_segment` count time from the
        start of the whole run, `least_steps` counts its steps, and the state may break `invariant`
        already. A caller whose solver or checks read these clears them.
        """
        field = self.field
        if isinstance(field, OwnField) and not self.timed:
            field = replace(field, t_start=float(field.time_at(elapsed)))
        return replace(self, field=field, start=state, end=duration)

    @property
    def field_parameters(self) -> Floats:
        """The field's parameters in the explicit form or, if there is none, in the mass form."""
        if self.parameters is None:
            return self.mass_form.parameters if self.mass_form else ()
        return self.parameters

    @property
    def plain(self) -> bool:
        """Whether the field is a function of the user's that runs as plain Python."""
        return bool(getattr(self.field, "plain", False))

    @property
    def dimension(self) -> int:
        """Number of components of the state."""
        return len(self.start)


def __getattr__(name: str) -> Any:
    return globals()[former_object(__name__, name, _FORMER)]
