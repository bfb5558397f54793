"""Period of a tumbler, an ellipsoid with a principal axis along the vorticity, at any St.

The body turns backwards: φ falls and w = -φ̇ is positive. The functions below have -φ as their
variable, which rises with time. They take it by way of s, tan(-φ) = √(b/a) tan s, at n equispaced
nodes of half a turn, s in [0, π), after which everything repeats. Per s, with r the relative lag of
the body behind the fluid,

    dw/ds = -ε⁻¹ r,   r = (1 - g/w) slope,   slope = d(-φ)/ds.
"""

from math import isfinite, nan, pi, sqrt

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.shape import Ellipsoid

# Collocation nodes in half a turn: the first try, and the last one, as each try has twice as many.
# The first is an estimate, which costs time alone. The last resolves ratios a/b up to 1000 in seconds.
_FIRST_NODES = 32
_MOST_NODES = 2048
# Steps of Newton's method. It converges quadratically from the marched guess: more would not help.
_MOST_STEPS = 20
# Largest decrease of w in a step of Newton's method, over w: w stays positive, as it does for any share
# below 1.
_MOST_CHANGE = 0.5
# Newton's method ends when no w changes by more than this, relative: as it converges quadratically,
# the square of it, far below rounding, is left.
_CONVERGED = 1e-9
# Relative difference of two periods, over √nodes, that counts as rounding: some 45 roundings of a
# number. An estimate: with half of it, some runs would take twice the nodes for the same digits.
_ROUNDOFF = 1e-14
# Rate w at which any body turns if St is large: the fluid's, half the shear rate.
_RATE_OF_FLUID = 0.5
# Half turns over which the guess marches: behind the first one it has forgotten its start, or St
# is so large that w hardly leaves it.
_MARCHED_HALF_TURNS = 2


def tumbling_period(ellipsoid: Ellipsoid, stokes: float, axis: int) -> float:
    """Period of one full turn on the limit cycle, in units of the inverse shear rate.

    The rate w = -φ̇ of the one angle φ obeys w dw/dφ = ε⁻¹(w - g) (`ultima`, `jw3`). Here g is
    (a²sin²φ + b²cos²φ)/(a² + b²), ε is St I/(8πX), and a, b are the semi-axes in the flow-gradient
    plane.
    Its solution of period π is found by collocation, not by waiting for the transient to decay, and
    T = 2∫d(-φ)/w over half a turn. It is 2π(κ + 1/κ), κ = a/b, at St = 0 and tends to 4π as St → ∞.

    Body axis `axis` (0, 1, 2) stays along the vorticity. The result is good to about 1e-13,
    relative. Raises ValueError if St is not finite or negative, or a/b too far from one to be
    resolved (1000 still is, in seconds).
    """
    if not (isfinite(stokes) and stokes >= 0):
        raise ValueError(f"stokes: got {stokes!r}, expected a finite number from 0 on")
    a, b = (ellipsoid.scaled_axes[(axis + step) % 3] for step in (1, 2))
    if stokes == 0:
        return 2 * pi * (a / b + b / a)
    damping = ellipsoid.damping[axis] / stokes  # ε⁻¹
    slope, equilibrium = _profile(a, b, _MOST_NODES)
    guess = _marched(slope, equilibrium, damping)
    nodes = _FIRST_NODES
    previous = nan
    while nodes <= _MOST_NODES:
        stride = _MOST_NODES // nodes
        rate = _collocated_rate(slope[::stride], equilibrium[::stride], damping, guess[::stride])
        # T = 2∫ slope/w ds over s from 0 to π; a mean over equispaced nodes is the integral over π.
        period = 2 * pi * float(np.mean(slope[::stride] / rate))
        if abs(period - previous) <= _ROUNDOFF * nodes**0.5 * period:
            return period
        nodes = 2 * nodes
        previous = period
    raise ValueError(
        f"semi_axes: {a!r} and {b!r} in the flow-gradient plane, expected a ratio closer to one"
    )


def weak_inertia_period_change(ellipsoid: Ellipsoid, stokes: float, axis: int) -> float:
    """Leading change of the period at small St: -4π ε² (a - b)²/(a² + b²), ε = St I/(8πX)."""
    # For a prolate spheroid this is `vivtp`; the period decreases. The next term is of order St⁴.
    a, b = (ellipsoid.scaled_axes[(axis + step) % 3] for step in (1, 2))
    return -4 * pi * (stokes / ellipsoid.damping[axis]) ** 2 * (a - b) ** 2 / (a * a + b * b)


def _profile(a: float, b: float, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """`slope` and the equilibrium rate g, each of shape (n,), at the nodes of s."""
    # A Fourier series converges the faster, the farther its function's singular points in complex s
    # are from the real axis. Per φ the zeros of g, at tan φ = ±ib/a, are as near as b/a for small
    # b/a. Per s they are as far as √(b/a), at tan s = ±iq, and so are the poles of the slope, at
    # tan s = ±i/q. The factor q = √(b/a) is the one that makes both distances equal.
    s = pi * np.arange(nodes) / nodes
    q = sqrt(b / a)
    # cos²φ = cos²s/square and sin²φ = q² sin²s/square.
    square = np.cos(s) ** 2 + q * q * np.sin(s) ** 2
    equilibrium = (a * a * q * q * np.sin(s) ** 2 + b * b * np.cos(s) ** 2) / (
        square * (a * a + b * b)
    )
    return q / square, equilibrium


def _marched(slope: np.ndarray, equilibrium: np.ndarray, damping: float) -> np.ndarray:
    """w, shape (n,), within O(1/n), by implicit Euler steps from w = 1/2 over two half turns."""
    # The equation contracts everywhere and each step has one positive root, so that this cannot
    # fail. `step` is ε⁻¹ slope ds, and the new w has w = rate - step (1 - g/w), which is
    # w² - 2 half w - step g = 0. The code writes its positive root in the way that adds, as a
    # difference would cancel.
    steps = (pi / len(slope) * damping * slope).tolist()
    rates = []
    rate = _RATE_OF_FLUID
    for _ in range(_MARCHED_HALF_TURNS):
        rates = []
        for step, g in zip(steps, equilibrium.tolist(), strict=True):
            half = (rate - step) / 2
            root = sqrt(half * half + step * g)
            rate = half + root if half > 0 else step * g / (root - half)
            rates.append(rate)
    return np.array(rates)


def _collocated_rate(
    slope: np.ndarray, equilibrium: np.ndarray, damping: float, rate: np.ndarray
) -> np.ndarray:
    """w, shape (n,), at the nodes, from a guess `rate`, shape (n,), by Newton's method.

    NaN if it does not converge.
    """
    # The equation is integrated once, which keeps it well-conditioned for any damping ε⁻¹:
    # w - ⟨w⟩ + ε⁻¹ ∫ r ds = 0, where ∫ is of zero mean. It has no mean itself. That of
    # dw/ds = -ε⁻¹ r, ⟨r⟩ = 0, takes the free place: both are added and vanish together.
    nodes = len(slope)
    integral = _antiderivative(nodes)
    mean = np.full((nodes, nodes), 1 / nodes)
    for _ in range(_MOST_STEPS):
        lag = slope * (1 - equilibrium / rate)  # r
        residual = rate - rate.mean() + damping * (integral @ lag) + lag.mean()
        # dr/dw = slope g/w².
        jacobian = (
            np.eye(nodes) - mean + (damping * integral + mean) * (slope * equilibrium / rate**2)
        )
        step = np.linalg.solve(jacobian, residual)
        rate = rate - step * min(1.0, _MOST_CHANGE / max(_MOST_CHANGE, np.max(step / rate)))
        if np.max(np.abs(step / rate)) < _CONVERGED:
            return rate
    return np.full(nodes, nan)


def _antiderivative(nodes: int) -> np.ndarray:
    """Matrix, shape (n, n), that takes a function of period π to its integral of zero mean.

    Both are given at the nodes. The mean of the function does not count, nor does its last Fourier
    mode, whose integral vanishes at all nodes.
    """
    with IMPORTS:
        from scipy.linalg import circulant

    # Functions of period π have even wave numbers; the integral of exp(iks) is exp(iks)/(ik).
    wave_numbers = np.fft.fftfreq(nodes, d=1 / (2 * nodes))
    factors = np.zeros(nodes, dtype=complex)
    resolved = (wave_numbers != 0) & (wave_numbers != -nodes)
    factors[resolved] = -1j / wave_numbers[resolved]
    return circulant(np.fft.ifft(factors).real)
