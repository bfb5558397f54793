"""Starts of an ensemble: distributions of orientation and motion, drawn from a seed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, ConfigDict, ValidationError, WrapValidator, model_validator

from polhode.models.files.scene_file import FourVector, Table, Vector
from polhode.models.flow import jeffery_spin
from polhode.models.forms.spheroid import Spheroid
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.shape import Ellipsoid

Motion = Literal["rest", "fluid", "jeffery", "momentum", "momentum-isotropic"]
"""How particles start.

"fluid" turns with the fluid, in shear ω = -½ ẑ. "jeffery" turns as without inertia, ω = Ω_J. "momentum"
has the given angular momentum, in space axes. "momentum-isotropic" has one of its length in any direction.
"""


def _either(value: Any, valid: Callable[[Any], Any]) -> Any:
    """The valid value; else ValueError with both choices, instead of what each lacks."""
    try:
        return valid(value)
    except ValidationError:
        # The first 60 characters, an estimate, tell which value it is.
        raise ValueError(
            f"got {value!r:.60}, expected 'isotropic' or a quaternion, four finite numbers"
        ) from None


class Starts(Table):
    """``[start]`` of a sweep file: a distribution of starts."""

    model_config = ConfigDict(frozen=True)
    # Tuples, so that ensembles can be hashed.
    orientation: Annotated[
        Literal["isotropic"] | Annotated[FourVector, AfterValidator(tuple)], WrapValidator(_either)
    ] = "isotropic"
    motion: Motion = "rest"
    angular_momentum: Annotated[Vector, AfterValidator(tuple)] | None = (
        None  # over the largest moment of inertia
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """The table, if orientation, motion and angular momentum go together."""
        q = self.orientation
        momentum = self.angular_momentum
        needs_momentum = self.motion.startswith("momentum")
        fits = any(momentum or ()) if needs_momentum else momentum is None
        if not fits:
            words = "three numbers, not all zero," if needs_momentum else "none"
            raise ValueError(
                f"got angular_momentum = {momentum}, expected {words} with motion {self.motion!r}"
            )
        if q != "isotropic" and not (isfinite(hypot(*q)) and any(q)):
            raise ValueError(f"got orientation = {q}, expected four numbers, not all zero")
        return self

    def draw(
        self,
        ellipsoid: Ellipsoid,
        seed: np.random.SeedSequence,
        particles: int,
        flow: Sequence[Any] | None = None,
    ) -> "Drawn":
        """Draw starts; the same seed gives the same orientations and directions whatever ellipsoid and flow.

        `flow` holds the numbers of the flow at the start (`polhode.models.flow.Flow.numbers`). Each is one
        for all particles, or an array with one for each. By default the flow is simple shear.
        """
        random = np.random.default_rng(seed)
        # Four standard normals, once normalised, make an isotropic orientation. They are drawn even if
        # the orientation is given, so that what is drawn after them stays the same.
        four = random.standard_normal((particles, 4))
        q = four if self.orientation == "isotropic" else np.tile(self.orientation, (particles, 1))
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        return Drawn(q, self._velocity(ellipsoid, matrix_from_quaternion(q), random, flow))

    def _velocity(
        self,
        ellipsoid: Ellipsoid,
        rotation: np.ndarray,
        random: np.random.Generator,
        flow: Sequence[Any] | None,
    ) -> np.ndarray:
        """Angular velocities in body axes, shape (n, 3), of matrices t_ij, shape (n, 3, 3)."""
        if self.motion == "rest":
            return np.zeros((len(rotation), 3))
        # The first three numbers of a flow are half its vorticity, in space axes: (0, 0, -½) in shear.
        if self.motion == "fluid" and flow is not None:
            spin = np.broadcast_to(np.array(flow[:3]).T, (len(rotation), 3))
            return np.einsum("nij,nj->ni", rotation, spin)
        if self.motion == "fluid":
            return -0.5 * rotation[:, :, 2]
        if self.motion == "jeffery":
            return jeffery_spin(ellipsoid, rotation, flow)
        assert self.angular_momentum is not None
        inertia = np.array(ellipsoid.inertia)
        momentum = np.tile(np.array(self.angular_momentum) * inertia.max(), (len(rotation), 1))
        if self.motion == "momentum-isotropic":
            directions = random.standard_normal((len(rotation), 3))
            length = np.linalg.norm(momentum, axis=1, keepdims=True)
            momentum = length * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return np.einsum("nij,nj->ni", rotation, momentum) / inertia


@dataclass(frozen=True)
class Drawn:
    """Starts of n particles: unit quaternions, shape (n, 4), and angular velocities in body axes, shape (n, 3)."""

    quaternion: np.ndarray
    angular_velocity: np.ndarray

    def states(self, form: str, ellipsoid: Ellipsoid) -> np.ndarray:
        """Starting states, shape (n, d), of a form without angles, by its name: what `Form.problem` makes of each."""
        q = self.quaternion
        omega = self.angular_velocity
        inertia = np.array(ellipsoid.inertia)
        if form == "jeffery":
            return q
        if form == "quaternion":
            return np.column_stack([q, omega])
        # L in space axes, shape (n, 3). `averaged` has L and E over I_max. `spheroid-axis` and
        # `averaged-spheroid` have L over the equatorial moment of inertia, then the axis or the spin about it.
        rotation = matrix_from_quaternion(q)
        momentum = np.einsum("nij,ni->nj", rotation, omega * inertia)
        if form == "averaged":
            energy = 0.5 * np.sum(omega**2 * inertia, axis=1)
            return np.column_stack([momentum, energy]) / max(ellipsoid.inertia)
        spheroid = Spheroid.of(ellipsoid)
        last = rotation[:, spheroid.axis] if form == "spheroid-axis" else omega[:, spheroid.axis]
        return np.column_stack([momentum / spheroid.equatorial_inertia, last])
