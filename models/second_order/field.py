"""Vector field of the second-order averaged triaxial ellipsoid, with the resonant modes that masks leave in it.

State y = (L/I_max, a, e₁, σ_α, σ_β): a² = -ln(1 - x) with x = (h - i₃)/(i₂ - i₃) says how far the polhode is from the
permanent axis, e₁ ⊥ L is carried along by parallel transport, the polhode phase is St σ_α and the precession phase
St σ_β. All coefficients are Chebyshev series in a², whose terms stand in the parameters p behind each other:

- `HEAD` numbers: middle and reciprocal half width of the table's a²;
- 20 series of `nodes` terms: `polhode.models.second_order.averages`, then ν₁ and ν₂;
- for each mode `MODE_HEAD` numbers (`mode`) and 12 series of `MODE_NODES` terms (`resonance`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from polhode.models.operations import Field, Operations

HEAD, SERIES = 2, 20
MODE_HEAD, MODE_SERIES, MODE_NODES = 10, 12, 20
# (1 + d⁴/POWER)^-POWER, by squaring DOUBLINGS times, comes close to exp(-d⁴) and falls as fast where it matters.
DOUBLINGS = 8
POWER = 2**DOUBLINGS


@dataclass(frozen=True)
class SlowField:
    """Factory of the field: rates of (L/I_max, a, e₁, σ_α, σ_β) in slow time."""

    nodes: int  # terms per series
    modes: int = 0  # resonant ones

    def __call__(self, ops: Operations) -> Field:
        """Bind the operations."""
        nodes, modes, root = self.nodes, self.modes, ops.sqrt
        averaged, resonant = ops.use(averaged_rates), ops.use(_mode)
        behind, each = HEAD + SERIES * nodes, MODE_HEAD + MODE_SERIES * MODE_NODES

        def rhs(y, p):
            lx, ly, lz, a, ex, ey, ez = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
            size = root(lx * lx + ly * ly + lz * lz)
            over = 1 / size
            nx, ny, nz = lx * over, ly * over, lz * over
            t = (a * a - p[0]) * p[1]
            f0, f2, g0, g2, r1, r2, ea, eb, a1, a2, b1, b2, p1, p2, p3, p4, p5, p6, nu1, nu2 = series(t, p, HEAD, nodes)
            growth, rise, tx, ty, tz = averaged(
                size, (nx, ny, nz), (f0, f2, a1, a2), (g0, g2, b1, b2), (r1, r2), (p1, p2, p3, p4, p5, p6)
            )
            s = nx * ny * over
            alpha, beta = size * nu1 + ea * s, size * nu2 + eb * s
            if modes > 0:
                fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
                for k in range(modes):
                    longer, higher, along, beside, ahead, turned = resonant(
                        size, (nx, ny, nz), (ex, ey), (fx, fy), a * a, nu1, nu2, y[7], y[8], p, behind + k * each
                    )
                    growth, rise = growth + longer, rise + higher
                    tx = tx + along * ex + beside * fx
                    ty = ty + along * ey + beside * fy
                    tz = tz + along * ez + beside * fz
                    alpha, beta = alpha + ahead, beta + turned
            lost = (ex * tx + ey * ty + ez * tz) * over
            return (
                growth * lx + tx,
                growth * ly + ty,
                growth * lz + tz,
                0.5 * a * rise,
                -lost * nx,
                -lost * ny,
                -lost * nz,
                alpha,
                beta,
            )

        return rhs


def series(t, p, at: int, nodes: int, count: int = SERIES) -> list[Any]:
    """Chebyshev series of `nodes` terms each, behind each other from p[at] on, at t."""
    polynomials = [1 + 0 * t, t]
    for _ in range(2, nodes):
        polynomials.append(2 * t * polynomials[-1] - polynomials[-2])
    found = []
    for first in range(at, at + count * nodes, nodes):
        total = p[first] + p[first + 1] * t
        for k in range(2, nodes):
            total = total + p[first + k] * polynomials[k]
        found.append(total)
    return found


def averaged_rates(ops: Operations) -> Callable[..., Any]:
    """Averaged rates l'/l, g and L'⊥, as `averages` and `spheroid` list them, from the coefficients of these."""

    def averaged(size, n, f, g, r, p):
        over = 1 / size
        sx, sy, s0 = 0.5 * n[1], 0.5 * n[0], n[0] * n[1]
        w, s = 0.5 * n[2] * over, s0 * over
        # L'⊥ = n × (S u₁ + W u₂) + S⊥ v₁ + W v₂ with S = (sx, sy, 0) and W = (sx, -sy, 0).
        u1, u2 = r[0] + over * s * p[2], r[1] + over * s * p[3]
        v1, v2 = over * (p[0] + p[4] * w), over * (p[1] + p[5] * w)
        ux, uy, flat = sx * (u1 + u2), sy * (u1 - u2), v1 * s0
        return (
            f[0] + f[1] * w + over * s * (f[2] + f[3] * w),
            g[0] + g[1] * w + over * s * (g[2] + g[3] * w),
            sx * (v1 + v2) - n[2] * uy - flat * n[0],
            sy * (v1 - v2) + n[2] * ux - flat * n[1],
            n[0] * uy - n[1] * ux - flat * n[2],
        )

    return averaged


def _mode(ops: Operations) -> Callable[..., Any]:
    sin, cos, where_positive = ops.sin, ops.cos, ops.where_positive

    def mode(size, n, e, f, a2, nu1, nu2, alpha, beta, p, at):
        """Rates by one masked mode and its conjugate: l'/l, (a²)'/a², L' along e₁ and e₂, σ_α', σ_β'.

        p[at:] holds k₁ and k₂ over the width; St k₁ and St k₂; the phase at the start; middle and reciprocal half width
        of the series' a²; 1 at the place of k₂ among 1, 2, 3. The series are those of `resonance`.
        """
        d = p[at] * nu1 + p[at + 1] * nu2
        mask = 1 / (1 + d * d * d * d / POWER)
        for _ in range(DOUBLINGS):
            mask = mask * mask
        phase = p[at + 4] + p[at + 2] * alpha + p[at + 3] * beta
        # 2iμ exp(iψ); outside the series' range the mask vanishes.
        re, im = -2 * mask * sin(phase), 2 * mask * cos(phase)
        t = (a2 - p[at + 5]) * p[at + 6]
        t = where_positive(1 - t * t, t, 0 * t)
        l1, l2, y1, y2, a1, a2, b1, b2, q1, q2, q3, q4 = series(t, p, at + MODE_HEAD, MODE_NODES, MODE_SERIES)
        c1, c2, c3 = p[at + 7], p[at + 8], p[at + 9]

        # Parts of the flow of one, two and no turns about n; x and y of it are (e₁ - ie₂, n)'s components.
        ar, ai = 0.5 * (n[0] * e[1] + n[1] * e[0]), -0.5 * (n[0] * f[1] + n[1] * f[0])
        br, bi = 0.5 * (n[0] * e[1] - n[1] * e[0]), -0.5 * (n[0] * f[1] - n[1] * f[0])
        tr, ti = e[0] * e[1] - f[0] * f[1], -(e[0] * f[1] + f[0] * e[1])
        sr, si, wr, wi = c1 * ar + c2 * tr, c1 * ai + c2 * ti, c1 * br, c1 * bi
        over = 1 / size
        lr, li = l1 * sr + l2 * wr, l1 * si + l2 * wi
        yr, yi = y1 * sr + y2 * wr, y1 * si + y2 * wi
        xr, xi = a1 * sr + a2 * wr, a1 * si + a2 * wi
        zr, zi = b1 * sr + b2 * wr, b1 * si + b2 * wi
        # (L'₁ + iL'₂) of the mode and (L'₁ - iL'₂) of the mode, over i.
        pr = q1 * (c1 * n[0] * n[1] + c2 * ar + c3 * tr) + q2 * c2 * br
        pi = q1 * (c2 * ai + c3 * ti) + q2 * (c2 * bi - 0.5 * c1 * n[2]) - q3 * c1 * size
        mr, mi = q4 * c1 * tr, q4 * c1 * ti
        return (
            over * (lr * re - li * im),
            over * (yr * re - yi * im),
            0.5 * ((pr + mr) * re - (pi + mi) * im),
            0.5 * ((pr - mr) * im + (pi - mi) * re),
            over * (xr * im + xi * re),
            over * (zr * im + zi * re),
        )

    return mode
