"""Pilot runs: a scene followed loosely, to learn how many rotations it takes and how it magnifies errors.

A pilot costs milliseconds. It follows a full form at tolerances a hundredfold apart; the difference
of two runs is the error of the looser one. A run of too many rotations is replaced by its twin: the
same slow motion at a smaller St, in which every rotation stands for several. Where there is no slow
motion, only the beginning is followed.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from math import ceil, inf, isfinite, pi
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from polhode.harness.picking.laws import Sensitivity
from polhode.harness.references.errors import Errors, errors, magnitude
from polhode.harness.references.rotations import damping_times, is_stiff, rotations
from polhode.models.catalogue import form as find_form, reference_form
from polhode.models.form import Form
from polhode.models.observables import Observables, angular_velocity
from polhode.models.problem import PlannedPiece
from polhode.models.scene import BodyStart, Scene, SlowStart, Start, StartAt, start_from
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.solve import Solution, solve

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
# A difference beyond this share of its largest possible value says nothing but that the tolerance
# was too loose.
SATURATED = 0.03
# A pilot whose error is a smaller share of its tolerance was lucky, or took a handful of steps:
# others will not be, as the next one shows.
LUCKY = 0.1
SAMPLES, FEW = 401, 51
# Rotations and steps of a run: some tenths of a second.
MOST_ROTATIONS, MOST_STEPS = 5_000.0, 300_000
# Tolerance at which the beginning of a run is followed to learn where it leads.
BEGUN = 1e-6
# Rotations of a twin, and of one that shows no more than how many steps a slow solver takes;
# rotations per damping time that make a motion fast enough to have the former. From rest it speeds
# up alike at every St, in times of √St.
TWIN_ROTATIONS, COUNTED_ROTATIONS, FAST = 1_000.0, 300.0, 50.0
# Tolerance at which a run errs by about as much whose tolerance is the error of the whole run.
WHOLE_RUN_TOLERANCE = 1e-6
# Errors grow with rotations not followed: those of L, which add up at random, at most like the
# root, those of an angle, whose rate is off, like their number and somewhat faster.
GROWTH = {"slow": 0.5, "orientation": 1.25}


@runtime_checkable
class InPieces(Protocol):
    """A form that follows parts of a run by the full equations, and the rest by averages, as its tolerance allows."""

    def plan(self, scene: Scene, tolerance: float, start_at: StartAt) -> tuple[PlannedPiece, ...]:
        """Pieces that a run is expected to take; where it stands at a time is asked for on the way."""
        ...


class PilotFailedError(ValueError):
    """The pilot of a scene did not come far enough to say anything about it."""


class Gain(NamedTuple):
    """The pilot's own error, slow over I_max or orientation in rad, at a tolerance; inf if lost at every one."""

    tolerance: float
    error: float


@dataclass(frozen=True, eq=False)
class Pilot:
    """What a pilot says about a scene."""

    scene: Scene
    followed: Scene  # the scene itself, its twin at a smaller St, or its beginning
    rotations: float  # N = ∫|ω|dt/2π of the scene
    observables: Observables  # of what was followed, at the tightest tolerance
    gains: dict[str, Gain]  # by what is wanted: "slow", and "orientation" but for spheres

    @property
    def direct(self) -> bool:
        """Whether the scene itself was followed to its end."""
        return self.followed == self.scene

    @property
    def twin(self) -> bool:
        """Whether the same slow motion was followed at a smaller St."""
        return self.followed.stokes != self.scene.stokes

    @property
    def to_the_end(self) -> bool:
        """Whether what was followed shows the slow motion of the whole run."""
        return self.direct or self.twin

    @property
    def per_radian(self) -> float | None:
        """What an error of the phase makes of L and E, of a motion that settles and was followed in its beginning."""
        slow, turned = self.gains["slow"], self.gains.get("orientation")
        if (
            self.to_the_end
            or self.rotations > FAST * self.damping_times
            or not turned
            or turned.error == inf
        ):
            return None
        grown = (self.scene.time / self.followed.time) ** (GROWTH["orientation"] - GROWTH["slow"])
        return grown * slow.error / slow.tolerance * turned.tolerance / turned.error

    @cached_property
    def counted(self) -> Scene:
        """What steps of slow solvers are counted on: a short twin, whose count per rotation is mostly within half."""
        share = COUNTED_ROTATIONS / max(1.0, self.rotations * self.followed.time / self.scene.time)
        return (
            _shrunk(self.followed, share)
            if share < 1 and 0 < self.scene.stokes < inf
            else self.followed
        )

    def turned(self, share: float) -> float:
        """Share of the run's rotations in the first `share` of its time."""
        return float(np.interp(share, np.linspace(0.0, 1.0, len(self._angles)), self._angles))

    def share_of(self, piece: PlannedPiece) -> float:
        """Share of the run's rotations in a piece of it."""
        return self.turned(piece.end / self.scene.time) - self.turned(piece.begin / self.scene.time)

    @cached_property
    def _angles(self) -> np.ndarray:
        speed = np.linalg.norm(angular_velocity(self.followed.ellipsoid, self.observables), axis=1)
        angles = np.append(0.0, np.cumsum(speed[1:] + speed[:-1]))
        return angles / angles[-1] if self.to_the_end and angles[-1] > 0 else np.array([0.0, 1.0])

    def start_at(self, time: float) -> Start | None:
        """Where the run stands at a time, but for the phases of a twin; none where it would take long to know."""
        share = time / self.scene.time
        if self.to_the_end:
            last = len(self.observables.energy) - 1
            row = min(ceil(share * last), last)
            return start_from(self.scene.ellipsoid, self.observables[row : row + 1])
        if share * self.rotations > MOST_ROTATIONS:
            return None
        return _end_of(replace(self.scene, time=time))

    @cached_property
    def damping_times(self) -> float:
        """S = T max(8πX/I)/St."""
        return damping_times(self.scene)

    @property
    def stiff(self) -> bool:
        """Whether stability would hold an explicit method back."""
        return is_stiff(self.scene)


@lru_cache(maxsize=1000)
def _end_of(scene: Scene) -> Start | None:
    """Where a run ends, loosely followed; none if it cannot be."""
    form = find_form(reference_form(scene))
    with suppress(PilotFailedError):
        return start_from(
            scene.ellipsoid, form.observe(scene, follow(form, scene, BEGUN).states[-1:])
        )
    return None


def oriented(scene: Scene) -> Scene:
    """The scene itself, or one of those that a start by L and E alone stands for: the middle axis across L."""
    if not isinstance(scene.start, SlowStart):
        return scene
    ellipsoid, momentum = scene.ellipsoid, np.array(scene.start.angular_momentum)
    size = float(np.linalg.norm(momentum))
    if size == 0:
        raise PilotFailedError(
            "the start has L = 0 and no orientation, expected one that determines the motion"
        )
    first, _, last = ellipsoid.order
    low, high = ellipsoid.inertia[first], ellipsoid.inertia[last]
    share = (
        1.0 if low == high else (2 * scene.start.energy / size**2 - 1 / high) / (1 / low - 1 / high)
    )
    share = min(1.0, max(0.0, share))
    body = np.zeros(3)
    body[first], body[last] = np.sqrt(share), np.sqrt(1 - share)
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.align_vectors([momentum], [body])[0].as_quat().tolist()
    v1, v2, v3 = (size * body / np.array(ellipsoid.inertia)).tolist()
    return replace(scene, start=BodyStart((w, x, y, z), (v1, v2, v3)))


@lru_cache(maxsize=300)
def pilot(scene: Scene) -> Pilot:
    """Follow a scene loosely; raises PilotFailedError if no run at any tolerance comes far enough."""
    whole = oriented(scene)
    try:
        count = rotations(whole)
    except ValueError as error:
        raise PilotFailedError(f"pilot: {error}") from None
    followed = _within_reach(whole, count)
    found = form_ladder(find_form(reference_form(followed)), followed)
    own = _grown(gains(followed.ellipsoid, found), whole.time / followed.time)
    return Pilot(whole, followed, count, found[-1][1], own)


def _grown(own: dict[str, Gain], gap: float) -> dict[str, Gain]:
    """Gains over `gap` times as many rotations."""
    return {
        want: gain._replace(error=gain.error * gap ** GROWTH[want]) for want, gain in own.items()
    }


def pilot_solver(scene: Scene) -> str:
    """The solver that follows a scene: implicit where stability would hold back an explicit one."""
    return "cyrk-radau" if is_stiff(scene) else "cyrk-vern8"


def samples_of(form: Form) -> int:
    """Output times of a form's pilot: few of one whose observables take longer than its steps."""
    return FEW if form.averaged and hasattr(form, "estimate") else SAMPLES


def follow(form: Form, scene: Scene, tolerance: float, solver: str | None = None) -> Solution:
    """One pilot run of a form, by the scene's pilot solver or another one; raises PilotFailedError if it fails."""
    problem, solver = form.problem(scene), solver or pilot_solver(scene)
    times = np.linspace(0.0, problem.end, samples_of(form))
    run = solve(problem, solver, tolerance, times, max_steps=MOST_STEPS)
    if not run.success:
        raise PilotFailedError(f"pilot: {form.name!r} by {solver!r} ended with {run.status.value}")
    return run


def gains(ellipsoid: Ellipsoid, found: list[tuple[float, Observables]]) -> dict[str, Gain]:
    """Gains of what is wanted from runs at several tolerances, the loosest first."""
    pairs = [
        (tolerance, errors(ellipsoid, loose, tight))
        for (tolerance, loose), (_, tight) in pairwise(found)
    ]
    limits = {
        "slow": SATURATED * max(magnitude(ellipsoid, found[-1][1]), 1e-300),
        "orientation": SATURATED * pi,
    }
    known = [want for want in limits if getattr(pairs[-1][1], want) is not None]
    # The loosest pair of all is left out: its error follows no law. Of one run, made twice in the
    # same few steps, nothing follows.
    telling = [each for each in pairs[1:] if each[1].slow or each[1].orientation] or pairs[1:][-1:]
    lucky = _lucky(ellipsoid, found)
    return {want: _first_below(telling, want, limits[want], lucky[want]) for want in known}


def _lucky(ellipsoid: Ellipsoid, found: list[tuple[float, Observables]]) -> dict[str, float]:
    """Shares of the tolerance below which a pilot was lucky; it is relative: errors of a large L are larger."""
    return {"slow": LUCKY * max(1.0, magnitude(ellipsoid, found[-1][1])), "orientation": LUCKY}


def _first_below(pairs: list[tuple[float, Errors]], name: str, limit: float, lucky: float) -> Gain:
    below = [
        (tolerance, value / tolerance)
        for tolerance, each in pairs
        if (value := getattr(each, name)) < limit
    ]
    if not below:
        return Gain(TOLERANCES[-1], inf)
    tolerance, share = below[0]
    # Where one was lucky the next tighter one need not be.
    return Gain(
        tolerance,
        tolerance * (share if share >= lucky else max(lucky, *(each for _, each in below[:2]))),
    )


@lru_cache(maxsize=100)
def form_ladder(form: Form, scene: Scene) -> list[tuple[float, Observables]]:
    """Pilot runs of a form at ever tighter tolerances until two of them agree, and not by luck."""
    found: list[tuple[float, Observables]] = []
    for tolerance in TOLERANCES:
        with suppress(PilotFailedError):
            found.append((tolerance, form.observe(scene, follow(form, scene, tolerance).states)))
        if len(found) < 3 or np.all(found[-1][1].slow == found[-2][1].slow):
            continue
        own, lucky = gains(scene.ellipsoid, found), _lucky(scene.ellipsoid, found)
        luck = any(gain.error <= lucky[want] * gain.tolerance for want, gain in own.items())
        if len(found) >= 3 + luck and all(isfinite(gain.error) for gain in own.values()):
            break
    if len(found) < 2:
        raise PilotFailedError(
            f"pilot: {form.name!r} by {pilot_solver(scene)!r} ended at no tolerance"
        )
    return found


def _within_reach(scene: Scene, count: float) -> Scene:
    """What to follow instead of a scene of `count` rotations."""
    if count <= MOST_ROTATIONS:
        return scene
    if 0 < scene.stokes < inf and count > FAST * damping_times(scene):
        return _shrunk(scene, TWIN_ROTATIONS / count)
    return replace(scene, time=scene.time * MOST_ROTATIONS / count)


def _shrunk(scene: Scene, share: float) -> Scene:
    """The same slow motion with a share of the rotations."""
    return replace(scene, stokes=scene.stokes * share, time=scene.time * share)


def averages(form: Form) -> bool:
    """Whether a form averages over rotations, be it in parts of a run alone."""
    return form.averaged or isinstance(form, InPieces)


def over_whole_run(form: Form, solver: str) -> bool:
    """Whether a method's tolerance is the error of the whole run."""
    return isinstance(form, InPieces) or (bool(solver) and find_solver(solver).many_periods)


def form_sensitivity(form: Form, pilot: Pilot, solver: str = "") -> dict[str, Sensitivity]:
    """Sensitivity of a form's solver error by what is wanted, from pilot runs of its own where that is cheap."""
    own, observables = pilot.gains, pilot.observables
    scene = pilot.scene if form.averaged else pilot.followed
    if over_whole_run(form, solver):
        # An error of L, which is relative where L is large, turns into one of the angle with every
        # rotation.
        turned = {
            "slow": max(1.0, magnitude(scene.ellipsoid, observables)),
            "orientation": 1.0 + pilot.rotations,
        }
        own = {want: Gain(WHOLE_RUN_TOLERANCE, WHOLE_RUN_TOLERANCE * turned[want]) for want in own}
    elif (
        not form.angles
        and form.name != reference_form(scene)
        and form.problem(scene).parameters is not None
    ):
        found = form_ladder(form, scene)
        own, observables = (
            _grown(gains(scene.ellipsoid, found), pilot.scene.time / scene.time),
            found[-1][1],
        )
    turns = 0.0 if form.averaged else pilot.rotations
    stiffness = 0.0 if form.averaged else pilot.damping_times / pilot.scene.time
    stiff = not form.averaged and pilot.stiff
    largest = {"slow": magnitude(scene.ellipsoid, observables), "orientation": 1.0}
    return {
        want: Sensitivity(*gain, turns, stiffness, largest[want], stiff)
        for want, gain in own.items()
    }
