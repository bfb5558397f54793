"""Period of a tumbler, an ellipsoid with a principal axis along the vorticity, at any St."""

from math import isfinite, nan, pi, sqrt

import numpy as np

from polhode.models.libraries import IMPORTS
from polhode.models.shape import Ellipsoid

# Collocation nodes in half a turn; they resolve ratios a/b up to 1000 in seconds.
_MOST_NODES = 2048
# Newton's method converges quadratically from the marched guess: more steps would not help.
_MOST_STEPS = 20
# Relative difference of two periods, over √nodes, that counts as rounding.
_ROUNDOFF = 1e-14


def tumbling_period(ellipsoid: Ellipsoid, stokes: float, axis: int) -> float:
    """Period of one full turn on the limit cycle, in units of the inverse shear rate.

    The rate w = -φ̇ of the one angle φ obeys w dw/dφ = ε⁻¹(w - g) (`ultima`, `jw3`). Here g is
    (a²sin²φ + b²cos²φ)/(a² + b²), ε is St I/(8πX), and a, b are the semi-axes in the flow-gradient
    plane.
    Its solution of period π is found by collocation, not by waiting for the transient to decay, and
    T = 2∫dφ/w over half a turn. It is 2π(κ + 1/κ), κ = a/b, at St = 0 and tends to 4π as St → ∞.

    Body axis `axis` (0, 1, 2) stays along the vorticity. The result is good to about 1e-13,
    relative. Raises ValueError if St is not finite or negative, or a/b too far from one to be
    resolved (1000 still is, in seconds).
    """
    if not (isfinite(stokes) and stokes >= 0):
        raise ValueError(f"stokes: got {stokes!r}, expected a finite number from 0 on")
    a, b = (ellipsoid.scaled_axes[(axis + step) % 3] for step in (1, 2))
    if stokes == 0:
        return 2 * pi * (a / b + b / a)
    damping = ellipsoid.damping[axis] / stokes
    slope, equilibrium = _profile(a, b, _MOST_NODES)
    guess = _marched(slope, equilibrium, damping)
    nodes = 32
    previous = nan
    while nodes <= _MOST_NODES:
        every = _MOST_NODES // nodes
        period = _collocated_period(slope[::every], equilibrium[::every], damping, guess[::every])
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
    """dφ/ds and g, each of shape (n,), at equispaced nodes of s in [0, π), tan φ = √(b/a) tan s."""
    # The map keeps both the zeros of g and its own poles as far as √(b/a) from the real axis.
    s = pi * np.arange(nodes) / nodes
    q = sqrt(b / a)
    square = np.cos(s) ** 2 + q * q * np.sin(s) ** 2
    equilibrium = (a * a * q * q * np.sin(s) ** 2 + b * b * np.cos(s) ** 2) / (
        square * (a * a + b * b)
    )
    return q / square, equilibrium


def _marched(slope: np.ndarray, equilibrium: np.ndarray, damping: float) -> np.ndarray:
    """w, shape (n,), within O(1/n), by implicit Euler steps from w = 1/2 over two half turns."""
    # The equation contracts everywhere and each step has one positive root, so that this cannot
    # fail.
    steps = (pi / len(slope) * damping * slope).tolist()
    rates = []
    rate = 0.5
    for _ in range(2):
        rates = []
        for step, g in zip(steps, equilibrium.tolist(), strict=True):
            half = (rate - step) / 2
            root = sqrt(half * half + step * g)
            rate = half + root if half > 0 else step * g / (root - half)
            rates.append(rate)
    return np.array(rates)


def _collocated_period(
    slope: np.ndarray, equilibrium: np.ndarray, damping: float, rate: np.ndarray
) -> float:
    """Period from the values of w, shape (n,), at equispaced nodes of s, by Newton's method.

    NaN if it fails.
    """
    # The equation is integrated once, which keeps it well-conditioned for any damping 1/ε: w - ⟨w⟩
    # + ε⁻¹ ∫ r ds = 0 and ⟨r⟩ = 0 with r = (1 - g/w) dφ/ds.
    with IMPORTS:
        from scipy.linalg import circulant

    nodes = len(slope)
    wave = np.fft.fftfreq(nodes, d=1 / (2 * nodes))
    inverse = np.zeros(nodes, dtype=complex)
    resolved = (wave != 0) & (wave != -nodes)
    inverse[resolved] = -1j / wave[resolved]
    integral = circulant(np.fft.ifft(inverse).real)
    mean = np.full((nodes, nodes), 1 / nodes)
    for _ in range(_MOST_STEPS):
        force = slope * (1 - equilibrium / rate)
        residual = rate - rate.mean() + damping * (integral @ force) + force.mean()
        jacobian = (
            np.eye(nodes) - mean + (damping * integral + mean) * (slope * equilibrium / rate**2)
        )
        step = np.linalg.solve(jacobian, residual)
        rate = rate - step * min(1.0, 0.5 / max(0.5, np.max(step / rate)))
        if np.max(np.abs(step / rate)) < 1e-9:
            return 2 * pi * float(np.mean(slope / rate))
    return nan
