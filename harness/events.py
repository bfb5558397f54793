"""Events: the times at which a function of the solution passes zero, found between the rows.

The function is first evaluated at looks: the times of the solution's rows, and times between them. If
its sign changes from one look to the next, SciPy's `brentq` finds the time.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np

from polhode.harness.solution import SceneSolution
from polhode.models.libraries import IMPORTS
from polhode.models.own_function import place_of
from polhode.models.registry import hint
from polhode.models.theory.fixed_points import attractors

# Looks, per step of the run on the average. An estimate: half as many miss pairs of passages that are
# twice as far apart, twice as many take twice the time.
_LOOKS_PER_STEP = 16
# Looks from one row to the next at least, where rows are closer than steps. An estimate, as before.
_LOOKS_PER_ROW = 4
# Looks in all, but for rounding up (`_looks`): a state of ten numbers at each takes 80 MB.
_MAX_LOOKS = 1_000_000
# Relative tolerance of the time of an event: the least that SciPy's `brentq` takes.
_RTOL = np.float64(4 * np.finfo(float).eps)
# Absolute tolerance of that time: `brentq` asks for a positive one, and the relative one is to decide.
_XTOL = 1e-300
# Steps of `brentq`: a thousand halvings reach 1e-301 of an interval that begins at t = 0. Between two
# halvings it may try an interpolation, which makes two thousand.
_MAX_BRENTQ_STEPS = 2000
# Largest difference, over the event's largest value, between the values of one row alone and among
# others. An estimate: rounding, which depends on the order of sums, stays far below it.
_SAME_VALUE = 1e-9
# Distance in L and E, over I_max, within which a particle has arrived; `Ensemble.radius` is the same.
# An estimate: the approach is exponential, so half of it delays the arrival by log 2 over the slowest rate.
ARRIVED = 0.05


@dataclass(frozen=True)
class Event:
    """A function of a solution that is followed through zero.

    Any function will do in its place, with SciPy's attributes `direction` and `terminal` if need be.

    Parameters
    ----------
    name : str
        The event's key in a solution's `events`.
    function : callable
        ``function(solution) -> values``, shape (n,) for a solution of n times. Each value follows
        from its own row alone.
    direction : float
        Positive: the event happens only where the function rises; negative: where it falls; 0: both.
    terminal : bool or int
        Whether the solution ends where the event happens; a number k: where it happens the k-th time.

    Raises
    ------
    ValueError
        If `terminal` is no bool and no whole number from 0 on.
    """

    name: str
    function: Callable[[Any], Any]
    direction: float = 0.0
    terminal: bool | int = False

    def __post_init__(self) -> None:
        if not isinstance(self.terminal, int | np.integer | np.bool_) or self.terminal < 0:
            got = f"event {self.name!r}: terminal: got {self.terminal!r}"
            raise ValueError(f"{got}, expected True, False or a positive whole number")

    def values(self, solution: Any) -> np.ndarray:
        """Its values along a solution, shape (n,).

        Raises ValueError, in one line, if the function raises, its shape is another, or no value is a number.
        """
        try:
            values = np.asarray(self.function(solution), dtype=float)
        except Exception as error:
            if self in EVENTS.values():
                raise
            cause = f"{type(error).__name__}: {error}{place_of(error, __file__)}"
            raise ValueError(f"event {self.name!r}: got {cause}") from error
        if values.shape != solution.times.shape:
            got = values.shape
            expected = solution.times.shape
            raise ValueError(f"event {self.name!r}: got values of shape {got}, expected {expected}")
        # At the start alone a quotient may be 0/0, as of a body at rest.
        unknown = values.size > 1 or not _known(solution)
        if values.size and np.isnan(values).all() and unknown:
            raise ValueError(f"event {self.name!r}: got no numbers, expected what the form knows")
        return values

    def ends(self, happened: Any) -> Any:
        """The time at which it ends a solution, shape (1,), or (0,) if it does not.

        `happened` is the solution at the times at which the event happens.
        """
        # True counts as 1: the first time.
        return happened.t[self.terminal - 1 : self.terminal] if self.terminal else happened.t[:0]


def _known(solution: Any) -> bool:
    """Whether the form knows all of the motion: an averaged one may know no orientation, which is NaN then."""
    observables = getattr(solution, "observables", None)
    # A solution of a problem has no observables, and knows its states.
    known = vars(observables).values() if observables else [solution.states]
    return all(np.isfinite(values).all() for values in known)


EventLike = str | Event | Callable[[Any], Any]


def separatrix(solution: SceneSolution) -> np.ndarray:
    """L² - 2EI₂, shape (n,), I₂ the middle moment of inertia; ValueError unless the ellipsoid is triaxial.

    It is positive while the particle spins about its shortest axis.
    """
    if (kind := solution.scene.ellipsoid.kind) != "triaxial":
        raise ValueError(
            f"event 'separatrix': got the kind {kind!r}, expected a triaxial ellipsoid"
        )
    middle = sorted(solution.scene.ellipsoid.inertia)[1]
    return np.sum(solution.angular_momentum**2, axis=1) - 2 * middle * solution.energy


def distance_to_settled(solution: SceneSolution) -> np.ndarray:
    """Distance of L and E, over I_max, from the nearest stable state, less the state's `reach`; shape (n,).

    The reach is the distance at which a solution has arrived: `ARRIVED` beyond the motion about the state.
    Raises ValueError in a flow other than simple shear, or if no stable state is known.
    """
    scene = solution.scene
    form = solution.equations
    if scene.flow is not None:
        expected = "simple shear, whose stable states are known"
        raise ValueError(f"event 'settled': got {scene.flow.words}, expected {expected}")
    states = attractors(scene.ellipsoid, scene.stokes, ARRIVED, circling=not form.averaged)
    if not states:
        raise ValueError(
            f"event 'settled': got St = {scene.stokes:g} and this shape, expected a stable state to reach"
        )
    slow = solution.observables.slow / max(scene.ellipsoid.inertia)
    return np.min(
        [np.linalg.norm(slow - attractor.state, axis=1) - attractor.reach for attractor in states],
        axis=0,
    )


_LZ = Event("lz", lambda solution: solution.angular_momentum[:, 2])
# A particle settles where the distance falls through zero.
_SETTLED = Event("settled", distance_to_settled, direction=-1.0)
EVENTS = {event.name: event for event in (Event("separatrix", separatrix), _LZ, _SETTLED)}


def as_events(events: Iterable[EventLike] | EventLike) -> list[Event]:
    """Events by name, as functions or as `Event`, all as `Event`.

    Raises ValueError if a name is unknown or stands there twice, or if something is none of the three.
    """
    accepted = []
    for event in (
        events if isinstance(events, Iterable) and not isinstance(events, str) else [events]
    ):
        event = EVENTS.get(event, event) if isinstance(event, str) else event
        if isinstance(event, Event):
            accepted.append(event)
        elif not callable(event):
            expected = f"one of {', '.join(EVENTS)}, or a function{hint(str(event), EVENTS)}"
            raise ValueError(f"events: got {event!r}, expected {expected}")
        else:
            direction = getattr(event, "direction", 0.0)
            terminal = getattr(event, "terminal", None) or False
            accepted.append(
                Event(getattr(event, "__name__", repr(event)), event, direction, terminal)
            )
    names = [event.name for event in accepted]
    if len(set(names)) < len(names):
        advice = "give a function by def, or Event(name, function)"
        raise ValueError(f"events: got the names {names}, expected each once: {advice}")
    return accepted


def happened(solution: Any, event: Event) -> Any:
    """The solution at the times at which an event happens, to some rounding errors of these times.

    An even number of passages between two looks goes unseen. Raises ValueError as `Event.values` does, and
    if a value depends on other rows than its own.
    """
    with IMPORTS:
        from scipy.optimize import brentq

    looked = solution(_looks(solution))
    values = event.values(looked)

    def value(t: float) -> float:
        """The event's value at a time; at a look it must be that among all looks."""
        # The first look that is not before t.
        i = np.searchsorted(looked.times, t)
        alone = float(event.values(looked(t))[0])
        if t < looked.times[i]:
            return alone
        if abs(alone - values[i]) > _SAME_VALUE * np.nanmax(np.abs(values)):
            got = f"got {alone:g} at t = {t:g} alone, {values[i]:g} among others"
            raise ValueError(
                f"event {event.name!r}: {got}, expected values that depend on their own row alone"
            )
        return float(values[i])

    # An event lies between look i and the next if the sign changes; one that starts at zero is none.
    sign = np.sign(values)
    times = []
    # 1 where the value rises to the next look, -1 where it falls.
    rising = np.where(sign[1:] != 0, sign[1:], -sign[:-1])
    passed = (sign[1:] != sign[:-1]) & (np.abs(sign[:-1]) == 1) & (event.direction * rising >= 0)
    for i in np.flatnonzero(passed).tolist():
        low, high = looked.times[i : i + 2].tolist()
        times.append(
            high
            if values[i + 1] == 0
            else brentq(value, low, high, xtol=_XTOL, rtol=_RTOL, maxiter=_MAX_BRENTQ_STEPS)
        )
    return looked(np.array(times))


def with_events(solution: SceneSolution, events: Iterable[Event]) -> SceneSolution:
    """The solution with its `events`, and no further than to the first event that ends it.

    Raises ValueError as `happened` does.
    """
    occurrences = {event.name: happened(solution, event) for event in events}
    ends = []
    for event in events:
        occurrence = occurrences[event.name]
        ends += [(time, occurrence) for time in event.ends(occurrence)]
    if ends:
        time, first = min(ends, key=itemgetter(0))
        end = first(time)
        solution = solution.until(end)
        occurrences = {
            name: occurrence.rows(occurrence.times <= end.times[0])
            for name, occurrence in occurrences.items()
        }
    return replace(solution, events=occurrences)


def _looks(solution: Any) -> np.ndarray:
    """The solution's times and equispaced ones between each two of them; shape (k,).

    The total follows from steps or rows, whichever asks for more, up to `_MAX_LOOKS`. It is rounded up, so
    that every interval gets the same number.
    """
    rows = len(solution.times) - 1
    looks = max(_LOOKS_PER_ROW * rows, _LOOKS_PER_STEP * (solution.work.steps or rows))
    # Rounded up.
    between = max(1, -(-min(looks, _MAX_LOOKS) // max(rows, 1)))
    return np.interp(np.arange(rows * between + 1) / between, np.arange(rows + 1), solution.times)
