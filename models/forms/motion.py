"""Common to the full forms: the vector equation `ultima` along the body axes, and the rates of a quaternion.

Parameters p of a full form are (alpha, beta, *shape, *flow), without the flow in simple shear. The forms
`quaternion` and `euler-angles`, which take every ellipsoid, have these:

- p[0]: alpha;
- p[1]: beta;
- p[2:5]: gyro, per axis (I₂ - I₃)/I₁ …;
- p[5:8]: damping rates 8πX_i/I_i;
- p[8:14]: in simple shear the six `shares`;
- p[8:16]: in any other flow its eight numbers (`polhode.models.flow`), which `AlongTrack` computes along a track.

Mass alpha stands on the angular velocity, factor beta on the torque: (1, 1/St) is the explicit
form, (St, 1) the implicit one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from polhode.models.flow import gyration, jeffery_angular_velocity, jeffery_in_any_flow, shares
from polhode.models.form import Form
from polhode.models.operations import Field, Operations
from polhode.models.problem import Factory, Floats, MassForm, ParameterTable, Problem
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid

# Numbers of a flow (`polhode.models.flow.Flow.numbers`): three of its vorticity, five of its strain.
_NUMBERS = 8


def body_parameters(ellipsoid: Ellipsoid) -> tuple[float, ...]:
    """Shape parameters of `angular_acceleration`: (I₂ - I₃)/I₁ and cyclic (`eulg`), damping rates, shares."""
    return *gyration(ellipsoid), *ellipsoid.damping, *shares(ellipsoid)


def parameters_of(scene: Scene) -> tuple[float, ...]:
    """Shape parameters in the scene's flow: `body_parameters`, without the shares where it is not simple shear."""
    ellipsoid = scene.ellipsoid
    if scene.flow is None:
        return body_parameters(ellipsoid)
    return *gyration(ellipsoid), *ellipsoid.damping


@dataclass(frozen=True)
class AlongTrack:
    """The factory of a field along a track: time is the state's last component.

    The last parameters of `field`, the flow's eight numbers, are cubics of the time since the last
    knot of the track. Their 32 coefficients and the knot's time stand in their place.
    """

    field: Factory
    others: int  # parameters before those of the flow
    timed: ClassVar[bool] = True

    def __call__(self, ops: Operations) -> Field:
        """Bind the field to a kind of number."""
        rhs = ops.use(self.field)
        others = self.others

        # The first `others` are alpha, beta and the shape's numbers; of `jeffery` the shape's alone.
        # p = | others | 8 constants | 8 slopes | 8 of squares | 8 of cubes | knot |
        def along(y, p):
            since = y[len(y) - 1] - p[others + 4 * _NUMBERS]
            square = since * since
            cube = square * since
            numbers = tuple(
                (p[i] + since * p[i + _NUMBERS])
                + (square * p[i + 2 * _NUMBERS] + cube * p[i + 3 * _NUMBERS])
                for i in range(others, others + _NUMBERS)
            )
            given = tuple(p[i] for i in range(others))
            return *rhs(y, (*given, *numbers)), 1.0

        return along


def in_its_flow(
    scene: Scene, in_shear: Factory, in_any_flow: Factory, others: int
) -> tuple[Factory, Floats, ParameterTable | None]:
    """The field for a scene's flow, the flow's parameters, which stand behind `others` more, and how they change."""
    flow = scene.flow
    if flow is None:
        return in_shear, (), None
    if not flow.varies:
        return in_any_flow, flow.numbers, None
    knots = np.array(flow.knots)
    rows = np.column_stack([flow.cubics.reshape(len(knots) - 1, -1), knots[:-1]])
    first = tuple(rows[flow.interval(0.0)].tolist())
    return AlongTrack(in_any_flow, others), first, ParameterTable(knots, rows)


def full_problem(
    form: Form,
    scene: Scene,
    field: Factory,
    start: Floats,
    inertial: tuple[bool, ...],
    shape: Floats,
    *,
    in_any_flow: Factory | None = None,
    **known: Any,
) -> Problem:
    """Initial value problem in time t of a form of the full equations; `known` is what else there is to a `Problem`.

    `field` is for simple shear, `in_any_flow` for any other linear flow; without it these
    are refused. `inertial` says of each component of the state whether its rate has the mass St,
    `shape` are the shape parameters in p.
    """
    if in_any_flow is None:
        form.require_flow(scene)
    field, flow, table = in_its_flow(scene, field, in_any_flow or field, 2 + len(shape))
    if table is not None:
        start = (*start, 0.0)
        inertial = (*inertial, False)
    # At St = 0 there is no explicit form, at St = inf no implicit one, which has the mass St on the
    # inertial rows.
    mass = tuple(scene.stokes if row else 1.0 for row in inertial)
    numbers = *shape, *flow
    explicit = (1.0, scene.torque_factor, *numbers) if scene.stokes > 0 else None
    implicit = MassForm(mass, (scene.stokes, 1.0, *numbers)) if scene.torque_factor > 0 else None
    return Problem(
        form.name, field, start, scene.time, explicit, implicit, parameter_table=table, **known
    )


def velocity_in_shear(ops: Operations) -> Callable:
    """Jeffery's angular velocity in simple shear, from the flow and gradient directions in body axes and p."""
    jeffery = ops.use(jeffery_angular_velocity)

    def velocity(x, y, p):
        six_shares = (p[8], p[9], p[10], p[11], p[12], p[13])
        return jeffery(x, y, six_shares)

    return velocity


def velocity_in_any_flow(ops: Operations) -> Callable:
    """Jeffery's angular velocity in a linear flow, from multiples of the space axes in body axes, their scale and p."""
    jeffery = ops.use(jeffery_in_any_flow)

    def velocity(x, y, z, scale, p):
        gyro = (p[2], p[3], p[4])
        flow = (p[8], p[9], p[10], p[11], p[12], p[13], p[14], p[15])
        return jeffery(x, y, z, scale, gyro, flow)

    return velocity


def driven_acceleration(ops: Operations) -> Callable:
    """Mass times ω̇ in body axes (`govg`), from ω and Jeffery's angular velocity, in whatever flow."""

    def acceleration(w, jeffery, p):
        alpha = p[0]
        beta = p[1]
        gyro1 = p[2]
        gyro2 = p[3]
        gyro3 = p[4]
        damping1 = p[5]
        damping2 = p[6]
        damping3 = p[7]
        w1, w2, w3 = w
        j1, j2, j3 = jeffery
        return (
            alpha * gyro1 * w2 * w3 - beta * damping1 * (w1 - j1),
            alpha * gyro2 * w3 * w1 - beta * damping2 * (w2 - j2),
            alpha * gyro3 * w1 * w2 - beta * damping3 * (w3 - j3),
        )

    return acceleration


def angular_acceleration(ops: Operations) -> Callable:
    """Mass times ω̇ in simple shear, from the flow and gradient directions in body axes and ω.

    Forms of users call it, as `docs/examples/own_form.py` does; polhode's own do not.
    """
    velocity = ops.use(velocity_in_shear)
    acceleration = ops.use(driven_acceleration)
    return lambda x, y, w, p: acceleration(w, velocity(x, y, p), p)


def directions(ops: Operations) -> Callable:
    """Flow and gradient directions in body axes, (t₁₁, t₂₁, t₃₁) and (t₁₂, t₂₂, t₃₂), of a quaternion of any norm."""
    # Divided by |q|², so that the norm, which solvers let drift, does not enter the torque. In
    # trials that no command repeats, at loose tolerances over long runs, this divided the errors by 10 to
    # 100. It keeps runs from blowing up that otherwise do (paper's ellipsoid, St = 1e4 and 1e5). A term that
    # restores the norm did no better there, cost a third more and bounds the step.

    def of(q0, q1, q2, q3):
        scale = 1 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        double = 2 * scale
        flow = (
            scale * (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3),
            double * (q1 * q2 - q0 * q3),
            double * (q1 * q3 + q0 * q2),
        )
        gradient = (
            double * (q1 * q2 + q0 * q3),
            scale * (q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3),
            double * (q2 * q3 - q0 * q1),
        )
        return flow, gradient

    return of


def space_axes(ops: Operations) -> Callable:
    """All three space axes in body axes times |q|², of a quaternion of any norm, and 1/|q|²."""

    def of(q0, q1, q2, q3):
        scale = 1 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        x2 = q1 * q2 - q0 * q3
        x3 = q1 * q3 + q0 * q2
        y1 = q1 * q2 + q0 * q3
        y3 = q2 * q3 - q0 * q1
        z1 = q1 * q3 - q0 * q2
        z2 = q2 * q3 + q0 * q1
        return (
            (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3, x2 + x2, x3 + x3),
            (y1 + y1, q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3, y3 + y3),
            (z1 + z1, z2 + z2, q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3),
            scale,
        )

    return of


def quaternion_rates(ops: Operations) -> Callable:
    """q̇ = ½ q∘(0, ω), ω in body axes."""

    def of(q0, q1, q2, q3, w1, w2, w3):
        return (
            -0.5 * (q1 * w1 + q2 * w2 + q3 * w3),
            0.5 * (q0 * w1 + q2 * w3 - q3 * w2),
            0.5 * (q0 * w2 + q3 * w1 - q1 * w3),
            0.5 * (q0 * w3 + q1 * w2 - q2 * w1),
        )

    return of


def norm_drift(states: np.ndarray) -> np.ndarray:
    """|q|² - 1 of states, shape (n, d), that begin with a quaternion."""
    return np.einsum("ij,ij->i", states[:, :4], states[:, :4]) - 1
