"""The one vector equation (`ultima`), resolved along the body axes: what every full form shares.

Parameters p of a full form: (alpha, beta, *shape), for a triaxial one (alpha, beta, gyro₁₋₃, damping₁₋₃, share₁₋₆).
Mass alpha stands on the angular velocity, factor beta on the torque: (1, 1/St) is the explicit form, (St, 1) the
implicit one.
"""

from collections.abc import Callable

from polhode.models.flow import jeffery_angular_velocity, shares
from polhode.models.operations import Operations
from polhode.models.problem import MassForm
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid


def gyroscopic_coefficients(ellipsoid: Ellipsoid) -> tuple[float, float, float]:
    """Coefficients (I₂ - I₃)/I₁ = (c² - b²)/(b² + c²) and cyclic of Euler's equations (`eulg`)."""
    a, b, c = ellipsoid.scaled_axes
    return (
        (c - b) * (c + b) / (b * b + c * c),
        (a - c) * (a + c) / (c * c + a * a),
        (b - a) * (b + a) / (a * a + b * b),
    )


def body_parameters(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Shape parameters of `angular_acceleration`: gyroscopic coefficients, damping rates, shares."""
    return *gyroscopic_coefficients(ellipsoid), *ellipsoid.damping, *shares(ellipsoid)


def explicit_parameters(scene: Scene, shape: tuple[float, ...]) -> tuple[float, ...] | None:
    """Parameters (1, 1/St, *shape) of the explicit form; None at St = 0, where there is none."""
    if scene.stokes == 0:
        return None
    return 1.0, scene.torque_factor, *shape


def mass_form(scene: Scene, inertial: tuple[bool, ...], shape: tuple[float, ...]) -> MassForm | None:
    """The form with mass St on the inertial rows, p = (St, 1, *shape), valid down to St = 0; None at St = inf."""
    if scene.torque_factor == 0:
        return None
    mass = tuple(scene.stokes if row else 1.0 for row in inertial)
    return MassForm(mass, (scene.stokes, 1.0, *shape))


def angular_acceleration(ops: Operations) -> Callable:
    """Mass times ω̇ in body axes (`govg`), from the flow and gradient directions in body axes and ω."""
    jeffery = ops.use(jeffery_angular_velocity)

    def acceleration(x, y, w, p):
        alpha, beta = p[0], p[1]
        w1, w2, w3 = w
        j1, j2, j3 = jeffery(x, y, (p[8], p[9], p[10], p[11], p[12], p[13]))
        return (
            alpha * p[2] * w2 * w3 - beta * p[5] * (w1 - j1),
            alpha * p[3] * w3 * w1 - beta * p[6] * (w2 - j2),
            alpha * p[4] * w1 * w2 - beta * p[7] * (w3 - j3),
        )

    return acceleration
