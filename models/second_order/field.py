"""Vector field of the second-order averaged triaxial ellipsoid, one and the same for every shape.

The state is y = (L/I_max, a, e₁, σ_α, σ_β). The distance of the polhode from the permanent axis is
a² = -ln(1 - x) with x = (h - i₃)/(i₂ - i₃). Parallel transport carries e₁ ⊥ L along. The polhode
phase is St σ_α and the precession phase St σ_β. All coefficients are functions of a², whose numbers
stand in the parameters p behind each other. `docs/second-order.md`, section 4, has the mathematics and
a drawing of p:

- `_HEAD` numbers: middle and reciprocal half width of the table's a²;
- 20 Chebyshev series of `NODES` terms: `polhode.models.second_order.averages`, then ν₁ and ν₂;
- for each of `POLES` resonances, where the averages of second order are singular, its a²,
  1/(St dD/da²), and the 10 functions' residues of second and of first order.

Within √(|dD/dt₂|/St) of its resonance a mode has no time to be averaged, and the poles end there
(`regular`).
"""

from collections.abc import Callable
from typing import Any

from polhode.models.operations import Field, Operations

# Components of the state.
STATE = ("Lx/Imax", "Ly/Imax", "Lz/Imax", "a", "e1x", "e1y", "e1z", "sigma_alpha", "sigma_beta")
# The functions in their order: first order, second order (these alone have poles), and the rates.
_FIRST = ("f0", "f2", "g0", "g2", "r1", "r2", "ea", "eb")
SECOND_ORDER = ("a1", "a2", "b1", "b2", "p1", "p2", "p3", "p4", "p5", "p6")
COEFFICIENTS = (*_FIRST, *SECOND_ORDER, "nu1", "nu2")
# Numbers in front of the series in p.
_HEAD = 2
_SERIES = len(COEFFICIENTS)
# Chebyshev terms of each series. An estimate: with them tables have functions of first order to 1e-10
# and functions of second order to 1e-5 in the median (tests/models/second_order/test_triaxial.py).
NODES = 32
# Resonances whose poles the field has room for. An estimate: if there are more, `tables.made` takes
# the ones with the largest residues.
POLES = 8
# Numbers of each pole.
POLE = 2 + 2 * len(SECOND_ORDER)
# Index in p of the first pole's numbers.
_FIRST_POLE = _HEAD + _SERIES * NODES
# Keeps 0/0 away where a run rests on a resonance.
_TINY = 1e-60


def field(ops: Operations) -> Field:
    """Rates of (L/I_max, a, e₁, σ_α, σ_β) in slow time."""
    root = ops.sqrt
    averaged = ops.use(averaged_rates)

    def rhs(y, p):
        lx = y[0]
        ly = y[1]
        lz = y[2]
        a = y[3]
        ex = y[4]
        ey = y[5]
        ez = y[6]
        size = root(lx * lx + ly * ly + lz * lz)
        over = 1 / size
        nx = lx * over
        ny = ly * over
        nz = lz * over
        coefficients = series((a * a - p[0]) * p[1], p)
        f0, f2, g0, g2, r1, r2, ea, eb = coefficients[: len(_FIRST)]
        # (a²)' of first order over l, as the divisors D of the table are over l, too. Times 1/(St dD/da²)
        # it is ±w², w being the width of the resonance in a².
        drift = a * a * (g0 + 0.5 * g2 * nz * over) * over
        for pole in range(_FIRST_POLE, _FIRST_POLE + POLES * POLE, POLE):
            # A pole's numbers: its a², 1/(St dD/da²), residues of second order, residues of first order.
            of_twice = pole + 2
            of_once = of_twice + len(SECOND_ORDER)
            twice, once = regular(a * a - p[pole], drift * p[pole + 1])
            for k in range(len(SECOND_ORDER)):
                coefficients[len(_FIRST) + k] += twice * p[of_twice + k] + once * p[of_once + k]
        a1, a2, b1, b2, *across, nu1, nu2 = coefficients[len(_FIRST) :]
        n = (nx, ny, nz)
        f = (f0, f2, a1, a2)
        g = (g0, g2, b1, b2)
        growth, rise, tx, ty, tz = averaged(size, n, f, g, (r1, r2), across)
        s = nx * ny * over
        # n'·e₁: parallel transport takes from e₁ what would leave it along n.
        lost = (ex * tx + ey * ty + ez * tz) * over
        return (
            growth * lx + tx,
            growth * ly + ty,
            growth * lz + tz,
            0.5 * a * rise,
            -lost * nx,
            -lost * ny,
            -lost * nz,
            size * nu1 + ea * s,
            size * nu2 + eb * s,
        )

    return rhs


def regular(x: Any, square: Any) -> tuple[Any, Any]:
    """Regular functions in place of 1/x² and 1/x, with `square` = ±w².

    The second is x³/(x⁴ + w⁴), the first minus its derivative. Far from 0 they are 1/x² and 1/x; at 0,
    where averaging fails, both vanish.
    """
    x2 = x * x
    w4 = square * square + _TINY
    over = 1 / (x2 * x2 + w4)
    return x2 * (x2 * x2 - 3 * w4) * over * over, x2 * x * over


def series(t: Any, p: Any) -> list[Any]:
    """The Chebyshev series at t, from -1 at a² = 0 to 1 at the table's end, in the order of `COEFFICIENTS`."""
    sums = []
    terms = polynomials(t, NODES)
    for first in range(_HEAD, _HEAD + _SERIES * NODES, NODES):
        total = p[first] + p[first + 1] * t
        for k in range(2, NODES):
            total = total + p[first + k] * terms[k]
        sums.append(total)
    return sums


def polynomials(t: Any, count: int) -> list[Any]:
    """The first Chebyshev polynomials at t."""
    values = [1 + 0 * t, t]
    twice = 2 * t
    while len(values) < count:
        values.append(twice * values[-1] - values[-2])
    return values


def averaged_rates(ops: Operations) -> Callable[..., Any]:
    """Averaged rates l'/l, g and L'⊥ from the coefficients that `averages` and `spheroid` list."""

    # The rates as `averages` has them: f = (f₀, f₂, a₁, a₂), g = (g₀, g₂, b₁, b₂), r = (r₁, r₂), p = (p₁,
    # … p₆). S_n is (sx, sy, 0) and W_n is (sx, -sy, 0); s is s₀/l and w is w₀/l.
    def averaged(size, n, f, g, r, p):
        nx, ny, nz = n
        f0, f2, a1, a2 = f
        g0, g2, b1, b2 = g
        r1, r2 = r
        p1, p2, p3, p4, p5, p6 = p
        over = 1 / size
        sx = 0.5 * ny
        sy = 0.5 * nx
        s0 = nx * ny
        w = 0.5 * nz * over
        s = s0 * over
        # L'⊥ = n × (S u₁ + W u₂) + S⊥ v₁ + W v₂ with S = (sx, sy, 0) and W = (sx, -sy, 0).
        # S⊥ is S - s₀n.
        u1 = r1 + over * s * p3
        u2 = r2 + over * s * p4
        v1 = over * (p1 + p5 * w)
        v2 = over * (p2 + p6 * w)
        ux = sx * (u1 + u2)
        uy = sy * (u1 - u2)
        flat = v1 * s0
        return (
            f0 + f2 * w + over * s * (a1 + a2 * w),
            g0 + g2 * w + over * s * (b1 + b2 * w),
            sx * (v1 + v2) - nz * uy - flat * nx,
            sy * (v1 - v2) + nz * ux - flat * ny,
            nx * uy - ny * ux - flat * nz,
        )

    return averaged
