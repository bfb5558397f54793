"""Celestial mechanics: close passages, for which steps must change by orders of magnitude."""

from math import sqrt

from polhode.models.operations import Field, Operations
from polhode.models.problem import Problem
from polhode.models.problems.classical import DETEST, HNW, IVP, Classical


def attraction(ops: Operations):
    sqrt = ops.sqrt

    def pull(y, i):
        """Acceleration of star i by the others; star j has the mass j + 1."""
        ax, ay = 0.0 * y[0], 0.0 * y[0]
        for j in range(7):
            if j != i:
                dx, dy = y[j] - y[i], y[7 + j] - y[7 + i]
                square = dx * dx + dy * dy
                weight = (j + 1.0) / (square * sqrt(square))
                ax, ay = ax + weight * dx, ay + weight * dy
        return ax, ay

    return pull


def pleiades_field(ops: Operations) -> Field:
    pull = ops.use(attraction)

    def rhs(y, p):
        (x1, y1), (x2, y2), (x3, y3), (x4, y4) = pull(y, 0), pull(y, 1), pull(y, 2), pull(y, 3)
        (x5, y5), (x6, y6), (x7, y7) = pull(y, 4), pull(y, 5), pull(y, 6)
        return (
            y[14], y[15], y[16], y[17], y[18], y[19], y[20],
            y[21], y[22], y[23], y[24], y[25], y[26], y[27],
            x1, x2, x3, x4, x5, x6, x7,
            y1, y2, y3, y4, y5, y6, y7,
        )  # fmt: skip

    return rhs


def arenstorf_field(ops: Operations) -> Field:
    sqrt = ops.sqrt
    moon = 0.012277471
    earth = 1 - moon

    def rhs(y, p):
        x, z, u, w = y[0], y[1], y[2], y[3]
        near, far = x + moon, x - earth
        a, b = near * near + z * z, far * far + z * z
        a3, b3 = a * sqrt(a), b * sqrt(b)
        return (
            u,
            w,
            x + 2 * w - earth * near / a3 - moon * far / b3,
            z - 2 * u - earth * z / a3 - moon * z / b3,
        )

    return rhs


def kepler_field(ops: Operations) -> Field:
    sqrt = ops.sqrt

    def rhs(y, p):
        square = y[0] * y[0] + y[1] * y[1]
        cube = square * sqrt(square)
        return y[2], y[3], -y[0] / cube, -y[1] / cube

    return rhs


_ARENSTORF = (0.994, 0.0, 0.0, -2.00158510637908252240537862224)

CELESTIAL = {
    "pleiades": Classical(
        Problem(
            "Pleiades",
            pleiades_field,
            (
                *(3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0),
                *(3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0),
                *(0.0, 0.0, 0.0, 0.0, 0.0, 1.75, -1.5),
                *(0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0),
            ),
            3.0,
        ),
        (
            *(0.3706139143970502, 0.3237284092057233e1, -0.3222559032418324e1, 0.6597091455775310),
            *(0.3425581707156584, 0.1562172101400631e1, -0.7003092922212495),
            *(-0.3943437585517392e1, -0.3271380973972550e1, 0.5225081843456543e1, -0.2590612434977470e1),
            *(0.1198213693392275e1, -0.2429682344935824, 0.1091449240428980e1),
            *(0.3417003806314313e1, 0.1354584501625501e1, -0.2590065597810775e1, 0.2025053734714242e1),
            *(-0.1155815100160448e1, -0.8072988170223021, 0.5952396354208710),
            *(-0.3741244961234010e1, 0.3773459685750630, 0.9386858869551073, 0.3667922227200571),
            *(-0.3474046353808490, 0.2344915448180937e1, -0.1947020434263292e1),
        ),
        False,
        f"{IVP}: Pleiades",
        ("taylor",),
    ),
    "arenstorf": Classical(
        Problem("Arenstorf", arenstorf_field, _ARENSTORF, 17.0652165601579625588917206249),
        _ARENSTORF,
        False,
        f"{HNW}: section II.0; the orbit closes after one period",
    ),
    "kepler": Classical(
        Problem("Kepler", kepler_field, (0.1, 0.0, 0.0, sqrt(19.0)), 20.0),
        (-1.29526625098758437, 0.400393896379232153, -0.677539092470756589, -0.127083815427868619),
        False,
        f"{DETEST}: D5, eccentricity 0.9; digits by Kepler's equation",
    ),
}
