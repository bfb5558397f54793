"""Events: the times at which a function of the solution passes zero, found between the rows.

The function is first evaluated at looks, times between the rows of the solution. Where its sign
changes from one look to the next, SciPy's `brentq` finds the time.
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

# Evaluations of the function: per step of the run, least number between two rows, and most in all.
_LOOKS_PER_STEP = 16
_LOOKS_PER_ROW = 4
_MOST_LOOKS = 1_000_000
# Relative tolerance of the time of an event: the least that SciPy's `brentq` takes.
_RTOL = np.float64(4 * np.finfo(float).eps)
# Share of the largest value: values of one row that differ by more differ by more than the order of
# sums.
_SAME = 1e-9
# Distance in L and E, over I_max, within which a particle has arrived.
ARRIVED = 0.05


@dataclass(frozen=True)
class Event:
    """A function of a solution of n times that returns n values, each of its own row alone, followed through zero.

    It happens only where the function rises if `direction` is positive, where it falls if negative;
    the solution ends there if it is `terminal`, at the n-th time if that is a number. Any function
    will do in its place, with SciPy's attributes of these names if need be.
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
        """Its values along a solution; raises ValueError, in one line, where there is not one for each time."""
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
        if values.size and np.isnan(values).all():
            raise ValueError(f"event {self.name!r}: got no numbers, expected what the form knows")
        return values

    def ends(self, happened: Any) -> Any:
        """The time at which it ends a solution in which it happened like this: one time, or none."""
        return happened.t[self.terminal - 1 : self.terminal] if self.terminal else happened.t[:0]


EventLike = str | Event | Callable[[Any], Any]


def separatrix(solution: SceneSolution) -> np.ndarray:
    """L² - 2EI₂, I₂ the middle moment of inertia: positive while the particle spins about its shortest axis."""
    if (kind := solution.scene.ellipsoid.kind) != "triaxial":
        raise ValueError(
            f"event 'separatrix': got the kind {kind!r}, expected a triaxial ellipsoid"
        )
    middle = sorted(solution.scene.ellipsoid.inertia)[1]
    return np.sum(solution.angular_momentum**2, axis=1) - 2 * middle * solution.energy


def distance_to_settled(solution: SceneSolution) -> np.ndarray:
    """Distance of L and E, over I_max, from the nearest stable state, less that within which it counts as arrived."""
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
_KNOWN = Event("separatrix", separatrix), _LZ, Event("settled", distance_to_settled, -1.0)
EVENTS = {event.name: event for event in _KNOWN}


def as_events(events: Iterable[EventLike] | EventLike) -> list[Event]:
    """Events by name, as functions or as `Event`; raises ValueError if a name is unknown or stands there twice."""
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
    """The solution at the times at which an event happens, to some rounding errors of these times."""
    # Between the looks (sixteen for a step of the run, on the average) an even number of passages
    # goes unseen.
    with IMPORTS:
        from scipy.optimize import brentq

    looked = solution(_looks(solution))
    values = event.values(looked)

    def value(t: float) -> float:
        """The event's value at a time; at a look it must be that among all looks."""
        # From the look before t: a step or two.
        i = np.searchsorted(looked.times, t)
        alone = float(event.values(looked(t))[0])
        if t < looked.times[i]:
            return alone
        if abs(alone - values[i]) > _SAME * np.nanmax(np.abs(values)):
            got = f"got {alone:g} at t = {t:g} alone, {values[i]:g} among others"
            raise ValueError(
                f"event {event.name!r}: {got}, expected values that depend on their own row alone"
            )
        return float(values[i])

    # An event lies between look i and the next if the sign changes; one that starts at zero is none.
    sign = np.sign(values)
    times = []
    rising = np.where(sign[1:] != 0, sign[1:], -sign[:-1])
    passed = (sign[1:] != sign[:-1]) & (np.abs(sign[:-1]) == 1) & (event.direction * rising >= 0)
    for i in np.flatnonzero(passed).tolist():
        low, high = looked.times[i : i + 2].tolist()
        times.append(
            high
            if values[i + 1] == 0
            else brentq(value, low, high, xtol=1e-300, rtol=_RTOL, maxiter=2000)
        )
    return looked(np.array(times))


def with_events(solution: SceneSolution, events: Iterable[Event]) -> SceneSolution:
    """The solution with what happened, and no further than to the first event that ends it."""
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
    """The solution's times and equispaced ones between each two of them."""
    rows = len(solution.times) - 1
    looks = max(_LOOKS_PER_ROW * rows, _LOOKS_PER_STEP * (solution.work.steps or rows))
    between = max(1, -(-min(looks, _MOST_LOOKS) // max(rows, 1)))
    return np.interp(np.arange(rows * between + 1) / between, np.arange(rows + 1), solution.times)
