"""A scene: all physics of one question, no numerics."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import frexp, hypot, inf, isfinite, isinf, ldexp

import numpy as np

from polhode.models import rotation
from polhode.models.flow import Flow, jeffery_angular_velocity, jeffery_spin, shares
from polhode.models.observables import (
    Observables,
    angular_velocity,
    completed,
    observe_body,
    observe_slow,
)
from polhode.models.operations import FLOAT
from polhode.models.rotation import Quaternion, Triple
from polhode.models.shape import Ellipsoid, require_numbers

# Within the next three bounds nothing that is computed of a scene, such as L²E, leaves the range of
# floating-point numbers, 1e-308 to 1e308.
#
# Largest number of a start, but for its energy: of angles in rad, rates in shear rates, and L.
_LARGEST = 1e30
# Least St above 0, and least duration, in inverse shear rates.
_LEAST = 1e-60
# Largest energy of a start, as energies go like the squares of angular velocities; and the largest error
# that may be requested.
MAX_NUMBER = 1e60
# Distance from 1 within which a norm is 1, some four roundings: a quaternion that was divided by its
# norm once lies within it.
_NORM_ROUNDING = 1e-15
# L² / 2E of a start may lie outside what the shape can have by this share. An estimate: rounding makes
# some 1e-16, numbers written with 14 digits make up to 2e-13.
_SLACK = 1e-12


@dataclass(frozen=True)
class EulerStart:
    """Start from Euler angles (θ, φ, ψ) in rad and their rates in units of the shear rate.

    Raises ValueError for a number that is not finite or exceeds `_LARGEST`, as the other two starts do.
    """

    angles: Triple
    rates: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _require_finite("start.euler_angles", self.angles, 3)
        _require_finite("start.euler_rates", self.rates, 3)

    @property
    def quaternion(self) -> Quaternion:
        """Orientation."""
        return rotation.quaternion_from_euler(self.angles)

    @property
    def angular_velocity(self) -> Triple:
        """Body angular velocity in units of the shear rate."""
        return rotation.angular_velocity_from_euler(self.angles, self.rates)


@dataclass(frozen=True)
class BodyStart:
    """Start from a quaternion, normalised here, and the body angular velocity in units of the shear rate.

    Raises ValueError for a quaternion of zeros, too.
    """

    quaternion: Quaternion
    angular_velocity: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _require_finite("start.angular_velocity", self.angular_velocity, 3)
        _require_finite("start.quaternion", self.quaternion, 4)
        norm = hypot(*self.quaternion)
        if not (isfinite(norm) and norm > 0):
            raise ValueError(
                f"start.quaternion: got {[*map(float, self.quaternion)]}, expected four numbers, not all zero"
            )
        # A normalised quaternion is not divided again: a scene stays what it is when its file is read.
        if abs(norm - 1) > _NORM_ROUNDING:
            # Quotients of denormal numbers lose digits; powers of two leave those of all others as they are.
            scaled = [ldexp(component, -frexp(norm)[1]) for component in self.quaternion]
            q0, q1, q2, q3 = (component / hypot(*scaled) for component in scaled)
            object.__setattr__(self, "quaternion", (q0, q1, q2, q3))

    @property
    def angles(self) -> Triple:
        """Euler angles (θ, φ, ψ) in rad."""
        return rotation.euler_from_quaternion(self.quaternion)


@dataclass(frozen=True)
class SlowStart:
    """Start from the slow variables alone, for averaged forms: L in space axes and E, in the units of `Observables`.

    Raises ValueError for an energy below 0 or above `MAX_NUMBER`, too.
    """

    angular_momentum: Triple
    energy: float

    def __post_init__(self) -> None:
        _require_finite("start.angular_momentum", self.angular_momentum, 3)
        require_numbers("start.energy", self.energy)
        if not 0 <= self.energy <= MAX_NUMBER:
            raise ValueError(
                f"start.energy: got {self.energy}, expected a number from 0 to {MAX_NUMBER:g}"
            )


def _require_finite(name: str, numbers: tuple[float, ...], length: int) -> None:
    """Raise ValueError unless these are `length` numbers of at most `_LARGEST` in size."""
    require_numbers(name, numbers, length)
    if not all(abs(number) <= _LARGEST for number in numbers):
        raise ValueError(
            f"{name}: got {[*map(float, numbers)]}, expected finite numbers of at most {_LARGEST:g}"
        )


Start = EulerStart | BodyStart | SlowStart


@dataclass(frozen=True)
class Scene:
    """One ellipsoid, its Stokes number, its start, and how long to follow it.

    Parameters
    ----------
    ellipsoid : Ellipsoid
    stokes : float
        Stokes number, 0 or from `_LEAST` to inf. At St = 0 the angular velocity is Jeffery's, whatever the
        start says.
    start : EulerStart, BodyStart or SlowStart
    time : float
        Duration in units of the inverse shear rate, finite, from `_LEAST` on.
    flow : Flow, optional
        The ambient flow; by default simple shear, which has equations of its own. Shear's own
        gradient means the same and becomes None.

    Raises
    ------
    ValueError
        If an argument is of another type, or St, the duration or t/St is out of range. If the flow's
        track does not cover the run, or the shape cannot have the L and E of a `SlowStart`.
    """

    ellipsoid: Ellipsoid
    stokes: float
    start: Start
    time: float
    flow: Flow | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.flow, Flow | None):
            raise ValueError(f"flow: got {self.flow!r:.60}, expected a Flow")
        if self.flow is not None and self.flow == Flow.shear():
            object.__setattr__(self, "flow", None)
        if not isinstance(self.ellipsoid, Ellipsoid):
            raise ValueError(f"ellipsoid: got {self.ellipsoid!r:.60}, expected an Ellipsoid")
        if not isinstance(self.start, Start):
            raise ValueError(
                f"start: got {self.start!r:.60}, expected an EulerStart, BodyStart or SlowStart"
            )
        require_numbers("stokes", self.stokes)
        require_numbers("time", self.time)
        if not (self.stokes == 0 or _LEAST <= self.stokes <= inf):
            raise ValueError(
                f"stokes: got {self.stokes}, expected 0 or a number from {_LEAST:g} to inf"
            )
        if not _LEAST <= self.time < inf:
            raise ValueError(f"time: got {self.time}, expected a finite number from {_LEAST:g} on")
        if self.flow is not None and not self.flow.covers(self.time):
            begin = self.flow.knots[0]
            end = self.flow.knots[-1]
            raise ValueError(
                f"flow.track: got times from {begin:g} to {end:g}, expected the run, 0 to {self.time:g}"
            )
        if 0 < self.stokes < inf and not 0 < self.slow_time < inf:
            raise ValueError(
                f"time: got {self.time} at St = {self.stokes}, expected a finite t/St above 0"
            )
        if isinstance(self.start, SlowStart):
            # L² / 2E of any rotation lies between the extreme moments of inertia.
            momentum = hypot(*self.start.angular_momentum)
            twice_energy = 2 * self.start.energy
            low = min(self.ellipsoid.inertia)
            high = max(self.ellipsoid.inertia)
            ratio = momentum / twice_energy * momentum if twice_energy > 0 else inf
            if not low * (1 - _SLACK) <= ratio <= high * (1 + _SLACK) and (
                momentum,
                twice_energy,
            ) != (0, 0):
                raise ValueError(
                    f"start: got L² / 2E = {ratio}, expected a value from {low} to {high}"
                )

    def later(self, elapsed: float, start: Start, time: float) -> "Scene":
        """The scene that goes on from a start after `elapsed`, for another `time`, in inverse shear rates."""
        flow = self.flow if self.flow is None else self.flow.after(elapsed)
        return replace(self, start=start, time=time, flow=flow)

    @property
    def slow_time(self) -> float:
        """Duration in slow time t₂ = t/St: 0 at St = inf, inf at St = 0."""
        return self.time / self.stokes if self.stokes > 0 else inf

    @property
    def torque_factor(self) -> float:
        """1/St: the factor of the torque in the explicit equations, inf at St = 0."""
        if self.stokes == 0:
            return inf
        return 0.0 if isinf(self.stokes) else 1 / self.stokes

    @cached_property
    def angular_velocity(self) -> Triple:
        """Body angular velocity at the start in units of the shear rate, Jeffery's at St = 0.

        Raises ValueError for a `SlowStart`, which has none.
        """
        if isinstance(self.start, SlowStart):
            raise ValueError(
                "start: L and E alone determine no angular velocity, expected an orientation"
            )
        if self.stokes > 0:
            return self.start.angular_velocity
        if self.flow is not None:
            spin = jeffery_spin(self.ellipsoid, self.initial_rotation[None], self.flow.numbers)
            w1, w2, w3 = spin[0].tolist()
            return w1, w2, w3
        columns = self.initial_rotation.T.tolist()
        return jeffery_angular_velocity(FLOAT)(columns[0], columns[1], shares(self.ellipsoid))

    @cached_property
    def initial_rotation(self) -> np.ndarray:
        """Matrix t_ij at the start, shape (3, 3): row i is body axis i in space; NaN for a `SlowStart`."""
        if isinstance(self.start, SlowStart):
            return np.full((3, 3), np.nan)
        return rotation.matrix_from_quaternion(np.array(self.start.quaternion))

    @cached_property
    def initial(self) -> Observables:
        """Observables at the start, with leading dimension 1; without orientation for a `SlowStart`."""
        if isinstance(self.start, SlowStart):
            return observe_slow(np.array([[*self.start.angular_momentum, self.start.energy]]))
        return observe_body(
            self.ellipsoid, self.initial_rotation[None], np.array([self.angular_velocity])
        )


def start_from(ellipsoid: Ellipsoid, observables: Observables) -> Start:
    """The start that has these observables, of one time; L and E alone where there is no orientation."""
    matrices = completed(ellipsoid, observables.rotation[:1])
    if matrices is None:
        l1, l2, l3 = observables.angular_momentum[0].tolist()
        # The run's own error may have led beyond what the shape can have.
        low, _, high = sorted(
            (l1 * l1 + l2 * l2 + l3 * l3) / (2 * inertia) for inertia in ellipsoid.inertia
        )
        return SlowStart((l1, l2, l3), min(max(float(observables.energy[0]), low), high))
    rotation_matrix = matrices[0]
    q0, q1, q2, q3 = rotation.quaternion_from_matrix(rotation_matrix).tolist()
    body = rotation_matrix @ angular_velocity(ellipsoid, observables)[0]
    return BodyStart((q0, q1, q2, q3), (float(body[0]), float(body[1]), float(body[2])))
