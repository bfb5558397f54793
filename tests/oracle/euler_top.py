"""Torque-free rotation from outside the project: extended-precision integration, and textbook formulas with mpmath."""

from functools import cache

import heyoka as hy
import mpmath as mp
import numpy as np

Long = np.longdouble


@cache
def integrator():
    """Taylor integration of q̇ = ½ q∘(0, ω) and Euler's equations in long double."""
    q0, q1, q2, q3, w1, w2, w3 = hy.make_vars("q0", "q1", "q2", "q3", "w1", "w2", "w3")
    i1, i2, i3 = (hy.par[k] for k in range(3))
    system = [
        (q0, -(q1 * w1 + q2 * w2 + q3 * w3) / 2),
        (q1, (q0 * w1 + q2 * w3 - q3 * w2) / 2),
        (q2, (q0 * w2 + q3 * w1 - q1 * w3) / 2),
        (q3, (q0 * w3 + q1 * w2 - q2 * w1) / 2),
        (w1, (i2 - i3) * w2 * w3 / i1),
        (w2, (i3 - i1) * w3 * w1 / i2),
        (w3, (i1 - i2) * w1 * w2 / i3),
    ]
    return hy.taylor_adaptive(
        system, [Long(0)] * 7, pars=[Long(1)] * 3, fp_type=Long, compact_mode=True
    )


def integrate(inertia, quaternion, omega, times):
    """Quaternions, shape (n, 4), and ω in body axes, shape (n, 3), in long double at increasing positive times."""
    taylor = integrator()
    taylor.time = Long(0)
    taylor.pars[:] = np.array(inertia, dtype=Long)
    taylor.state[:] = np.concatenate(
        [unit(np.array(quaternion, dtype=Long)), np.array(omega, dtype=Long)]
    )
    outcome, *_, states = taylor.propagate_grid(np.concatenate([[0], times]).astype(Long))
    assert outcome == hy.taylor_outcome.time_limit
    return states[1:, :4], states[1:, 4:]


def unit(quaternions):
    return quaternions / np.sqrt(np.sum(quaternions**2, axis=-1, keepdims=True))


def geodesic(left, right):
    """Angle in rad between orientations; through the chord, as an arccosine would lose half the digits."""
    left, right = unit(left), unit(right)
    chord = np.minimum(np.linalg.norm(left - right, axis=-1), np.linalg.norm(left + right, axis=-1))
    return 4 * np.arcsin(chord / 2)


def precise(value):
    """The same number for mpmath."""
    numerator, denominator = Long(value).as_integer_ratio()
    return mp.mpf(numerator) / denominator


def matrix(quaternion):
    """Matrix from body to space components, of a quaternion of any norm."""
    q0, q1, q2, q3 = map(precise, quaternion)
    norm = q0**2 + q1**2 + q2**2 + q3**2
    cross = mp.matrix([[0, -q3, q2], [q3, 0, -q1], [-q2, q1, 0]])
    return mp.eye(3) + 2 * (q0 * cross + cross * cross) / norm


def textbook(inertia, quaternion, omega, times):
    """Orientation matrix (body to space) and ω at each time, by Euler angles about L and Legendre's third integral.

    Axes are renamed, so that the third is the one that the polhode encircles, with ω₃ > 0. Precision is mpmath's.
    """
    inertia, omega = list(map(precise, inertia)), list(map(precise, omega))
    momentum_squared = sum((i * w) ** 2 for i, w in zip(inertia, omega, strict=True))
    energy = sum(i * w**2 for i, w in zip(inertia, omega, strict=True)) / 2
    order = sorted(range(3), key=inertia.__getitem__)
    order = order if momentum_squared > 2 * energy * inertia[order[1]] else order[::-1]
    axes = mp.matrix(3, 3)
    for row, axis in enumerate(order):
        axes[row, axis] = 1
    axes[2, order[2]] = mp.sign(omega[order[2]])
    axes[1, order[1]] = mp.det(axes)
    i1, i2, i3 = (inertia[axis] for axis in order)
    start = axes * mp.matrix(omega)
    spin, wobble, momentum = (
        momentum_squared - 2 * energy * i1,
        2 * energy * i3 - momentum_squared,
        mp.sqrt(momentum_squared),
    )
    amplitudes = (
        mp.sqrt(wobble / (i1 * (i3 - i1))),
        mp.sqrt(wobble / (i2 * (i3 - i2))),
        mp.sqrt(spin / (i3 * (i3 - i1))),
    )
    rate = mp.sign(i3 - i2) * mp.sqrt((i3 - i2) * spin / (i1 * i2 * i3))
    m, n = (i2 - i1) * wobble / ((i3 - i2) * spin), -i3 * (i2 - i1) / (i1 * (i3 - i2))
    half, third = 2 * mp.ellipk(m), 2 * mp.ellippi(n, m)

    def third_kind(amplitude, half_turns):
        return mp.ellippi(n, amplitude, m) + half_turns * third

    amplitude0 = mp.atan2(start[1] / amplitudes[1], start[0] / amplitudes[0])

    def frame(u, time):
        half_turns = mp.nint(u / half)
        sn, cn, dn = (mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn"))
        sign = (-1) ** int(half_turns)
        phase = third_kind(mp.atan2(sign * sn, sign * cn), half_turns) - third_kind(amplitude0, 0)
        phi = momentum * time / i3 + momentum * (i3 - i1) / (i1 * i3 * rate) * phase
        rates = mp.matrix([amplitudes[0] * cn, amplitudes[1] * sn, amplitudes[2] * dn])
        x, y, z = i1 * rates[0], i2 * rates[1], i3 * rates[2]
        theta, psi = mp.atan2(mp.sqrt(x * x + y * y), z), mp.atan2(x, y)
        return about_z(phi) * about_x(theta) * about_z(psi), rates

    u0 = mp.ellipf(amplitude0, m)
    before, _ = frame(u0, 0)
    results = []
    for time in map(precise, times):
        after, rates = frame(u0 + rate * time, time)
        turn = axes.T * before.T * after * axes
        results.append((matrix(quaternion) * turn, axes.T * rates))
    return results


def about_z(angle):
    return mp.matrix(
        [[mp.cos(angle), -mp.sin(angle), 0], [mp.sin(angle), mp.cos(angle), 0], [0, 0, 1]]
    )


def about_x(angle):
    return mp.matrix(
        [[1, 0, 0], [0, mp.cos(angle), -mp.sin(angle)], [0, mp.sin(angle), mp.cos(angle)]]
    )


def small_angle(matrix):
    """Angle in rad of a rotation matrix close to the identity."""
    return float(
        mp.norm(
            mp.matrix(
                [
                    matrix[2, 1] - matrix[1, 2],
                    matrix[0, 2] - matrix[2, 0],
                    matrix[1, 0] - matrix[0, 1],
                ]
            )
        )
        / 2
    )
