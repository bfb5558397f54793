"""Periods and mean speed of the torque-free rotation, and the paper's formulas for it."""

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from oracle import first_principles
from polhode.models.free_top.elliptic import exact
from polhode.models.free_top.polhode import Polhode, exactly, mean_speed
from polhode.models.free_top.torque_free import TorqueFree
from polhode.models.observables import observe_body
from polhode.models.rotation import matrix_from_quaternion
from polhode.models.shape import Ellipsoid

UNTURNED = (1.0, 0.0, 0.0, 0.0)


def random_body(seed):
    rng = np.random.default_rng(seed)
    quaternion, omega = rng.normal(size=4), rng.normal(size=3)
    return TorqueFree(
        tuple(rng.uniform(0.2, 1.0, 3)),
        tuple(quaternion / np.linalg.norm(quaternion)),
        tuple(omega),
    )


def momentum_and_energy(body):
    """L in space axes and E at the start."""
    moment = np.array(body.inertia) * body.angular_velocity
    return moment @ matrix_from_quaternion(
        np.array(body.quaternion)
    ), moment @ body.angular_velocity / 2


@pytest.mark.parametrize("exchange", [False, True])
def test_printed_angular_velocity(exchange):
    """`eq:omg1`–`eq:omg3` with the printed signs, T = 4K/(dτ/dt), and the exchange of 1 and 3 as it stands."""
    i1, i2, i3 = (0.8, 0.5, 0.3) if exchange else (0.3, 0.5, 0.8)
    momentum, energy = 1.0, 0.5 * (1 / i2 + (1 / i3 - 1 / i2) * 0.4)
    wobble, spin = 2 * energy * i3 - momentum**2, momentum**2 - 2 * energy * i1
    rate, k2 = np.sqrt((i3 - i2) * spin / (i1 * i2 * i3)), (i2 - i1) * wobble / ((i3 - i2) * spin)
    times = np.linspace(-40, 40, 81)
    sn, cn, dn, _ = ellipj(rate * times, k2)
    amplitudes = [
        np.sqrt(wobble / (i1 * (i3 - i1))),
        np.sqrt(wobble / (i2 * (i3 - i2))),
        np.sqrt(spin / (i3 * (i3 - i1))),
    ]
    printed = np.stack([amplitudes[0] * cn, amplitudes[1] * sn, amplitudes[2] * dn], axis=1)
    # The exchange renames: axis 1 remains the one of least inertia.
    forward = slice(None, None, -1 if exchange else 1)
    body = TorqueFree((i1, i2, i3)[forward], UNTURNED, (amplitudes[0], 0.0, amplitudes[2])[forward])
    assert np.max(np.abs(body.at(times)[1] - printed[:, forward])) < 1e-13
    assert body.period == pytest.approx(4 * ellipk(k2) / rate, rel=1e-13)


@pytest.mark.parametrize("exchange", [False, True])
def test_corrected_precession_period(exchange):
    """`eq:prec2` with ζ → −ζ where L² > 2EI₂, as printed after the exchange of 1 and 3; the other sign is far off."""
    i1, i2, i3 = (0.8, 0.5, 0.3) if exchange else (0.3, 0.5, 0.8)
    momentum, energy = 1.0, 0.5 * (1 / i2 + (1 / i3 - 1 / i2) * 0.4)
    with mp.workdps(30):
        wobble, spin = 2 * energy * i3 - momentum**2, momentum**2 - 2 * energy * i1
        k2 = (i2 - i1) * wobble / ((i3 - i2) * spin)
        quarter, rate = mp.ellipk(k2), mp.sqrt((i3 - i2) * spin / (i1 * i2 * i3))
        nome = mp.qfrom(m=k2)
        zeta = mp.ellipf(mp.atan(mp.sqrt(i3 * spin / (i1 * wobble))), 1 - k2) / (2 * quarter)
        ratio = (
            mp.pi * mp.jtheta(4, 1j * mp.pi * zeta, nome, 1) / mp.jtheta(4, 1j * mp.pi * zeta, nome)
        )
        term = float(mp.re(2j * ratio * rate / (4 * quarter)))
    sign = -1 if exchange else 1
    _, precession_period = Polhode.of(
        exactly((i1, i2, i3)), exact(momentum) ** 2, 2 * exact(energy)
    ).periods
    assert 2 * np.pi / precession_period == pytest.approx(momentum / i1 + sign * term, rel=1e-14)
    assert abs(2 * np.pi / precession_period - (momentum / i1 - sign * term)) > 0.1


def test_periods_where_they_are_infinite_or_limits():
    inertia = (0.3, 0.5, 0.8)
    assert TorqueFree(inertia, UNTURNED, (0.0, 0.0, 0.0)).period == np.inf
    assert TorqueFree(inertia, UNTURNED, (0.0, 0.0, 0.0)).precession_period == np.inf
    unstable = TorqueFree(inertia, UNTURNED, (0.0, 2.0, 0.0))
    assert (unstable.period, unstable.precession_period) == (np.inf, pytest.approx(np.pi))
    separatrix = TorqueFree((6.0, 3.0, 4.0), UNTURNED, (-1.0, 2.0, 0.3))
    assert (separatrix._polhode.m1, separatrix.period) == (0, np.inf)
    for axis in (0, 2):
        still, wobbling = (np.eye(3)[axis] + shift for shift in (0.0, 1e-9))
        limit, near = (TorqueFree(inertia, UNTURNED, tuple(omega)) for omega in (still, wobbling))
        assert limit.is_permanent
        assert not near.is_permanent
        assert limit.period == pytest.approx(near.period, rel=1e-8)
        assert limit.precession_period == pytest.approx(near.precession_period, rel=1e-8)
    sphere = TorqueFree((0.5, 0.5, 0.5), UNTURNED, (0.6, 0.0, 0.8))
    assert (sphere.period, sphere.precession_period) == (np.inf, pytest.approx(2 * np.pi))


def test_period_and_precession_describe_the_motion():
    for seed in range(6):
        body = random_body(seed)
        start, after = body.at([0.0, body.period])[1]
        assert np.max(np.abs(start - after)) < 1e-13
        turns = 10000
        times = body.period * np.arange(3) * turns
        axis = body._polhode.order[2]
        rows = matrix_from_quaternion(body.at(times)[0])[:, axis]
        momentum, _ = momentum_and_energy(body)
        along = momentum / np.linalg.norm(momentum)
        flat = rows - np.outer(rows @ along, along)
        angle = np.arctan2(along @ np.cross(flat[0], flat[1]), flat[0] @ flat[1])
        expected = 2 * np.pi * body.period * turns / body.precession_period
        assert abs(np.remainder(angle - expected + np.pi, 2 * np.pi) - np.pi) < 1e-9


def wobbling_start(semi_axes, omega):
    ellipsoid = Ellipsoid(semi_axes)
    return ellipsoid, observe_body(ellipsoid, np.eye(3)[None], np.array([omega])).slow


TOPS = [
    ((1.0, 0.8, 0.5), (0.1, 0.2, 1.0)),
    ((1.0, 0.8, 0.5), (1.0, 0.2, -0.1)),
    ((0.5, 1.0, 0.8), (0.3, 0.5, 1.0)),
    ((1.0, 0.1, 0.15), (2.0, 0.05, 0.3)),
]


@pytest.mark.parametrize(("semi_axes", "omega"), TOPS)
def test_fast_motion_against_quadrature_along_the_polhode(semi_axes, omega):
    ellipsoid, slow = wobbling_start(semi_axes, omega)
    curve = first_principles.polhode(
        np.array(ellipsoid.inertia), np.linalg.norm(slow[0, :3]), float(slow[0, 3]), nodes=4096
    )
    speed = curve.weight @ np.linalg.norm(curve.momentum / ellipsoid.inertia, axis=1)
    assert mean_speed(ellipsoid, slow)[0] == pytest.approx(speed, rel=1e-6)
    assert TorqueFree(ellipsoid.inertia, UNTURNED, omega).period == pytest.approx(
        curve.period, rel=1e-9
    )


@pytest.mark.parametrize(("semi_axes", "omega"), [TOPS[0], TOPS[1]])
def test_precession_period_against_the_turns_of_the_encircled_axis(semi_axes, omega):
    """The body axis that the polhode encircles goes about L: its mean rate over whole periods T is 2π/T'."""
    ellipsoid, slow = wobbling_start(semi_axes, omega)
    top = TorqueFree(ellipsoid.inertia, UNTURNED, omega)
    inertia, momentum = np.array(ellipsoid.inertia), slow[0, :3]
    axis = first_principles.enclosed_axis(inertia, np.linalg.norm(momentum), float(slow[0, 3]))
    frame = first_principles.aligned_frame(momentum)

    def field(_, rows):
        rotation = rows.reshape(3, 3)
        return -np.cross(rotation @ momentum / inertia, rotation.T).T.ravel()

    periods = 6
    times = np.linspace(0, periods * top.period, 4001)
    run = solve_ivp(
        field,
        (0, times[-1]),
        np.eye(3).ravel(),
        t_eval=times,
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
    )
    across = run.y.T.reshape(-1, 3, 3)[:, axis] @ frame
    angle = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))
    assert (angle[-1] - angle[0]) / times[-1] == pytest.approx(
        2 * np.pi / top.precession_period, rel=1e-8
    )


@pytest.mark.parametrize("semi_axes", [(1.0, 1.0, 2.0), (0.4, 1.0, 1.0), (2.0, 2.0, 2.0)])
def test_speed_of_symmetric_tops_is_constant(semi_axes):
    ellipsoid, slow = wobbling_start(semi_axes, (0.3, -0.7, 0.2))
    assert mean_speed(ellipsoid, slow)[0] == pytest.approx(
        np.linalg.norm((0.3, -0.7, 0.2)), rel=1e-12
    )


@pytest.mark.parametrize(
    "omega", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0)]
)
def test_speed_of_permanent_rotations(omega):
    ellipsoid, slow = wobbling_start((1.0, 0.8, 0.5), omega)
    tolerance = 0.05 if omega[1] else 1e-7
    assert mean_speed(ellipsoid, slow)[0] == pytest.approx(
        np.linalg.norm(omega), rel=tolerance, abs=0
    )
