"""Classical problems with published reference solutions, as plain problems.

Sources: [IVP] F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4 (2008), University of
Bari; [HNW] E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993);
[DETEST] W. H. Enright, J. D. Pryce, Two FORTRAN packages for assessing initial value methods, ACM Trans. Math.
Software 13 (1987) 1, with the reference values of its program NSDTST.
"""

from dataclasses import dataclass

import numpy as np

from polhode.models.operations import Field, Operations
from polhode.models.problem import MassForm, Problem


@dataclass(frozen=True)
class Classical:
    """A problem and its published solution at the end."""

    problem: Problem
    reference: tuple[float, ...]
    stiff: bool

    def error(self, state: np.ndarray) -> float:
        """Largest error of a component, relative where the component exceeds one in size."""
        reference = np.array(self.reference)
        return float(np.max(np.abs(state - reference) / np.maximum(1.0, np.abs(reference))))


def hires_field(ops: Operations) -> Field:
    def rhs(y, p):
        y1, y2, y3, y4, y5, y6, y7, y8 = y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7]
        bound = 280 * y6 * y8
        return (
            -1.71 * y1 + 0.43 * y2 + 8.32 * y3 + 0.0007,
            1.71 * y1 - 8.75 * y2,
            -10.03 * y3 + 0.43 * y4 + 0.035 * y5,
            8.32 * y2 + 1.71 * y3 - 1.12 * y4,
            -1.745 * y5 + 0.43 * y6 + 0.43 * y7,
            -bound + 0.69 * y4 + 1.71 * y5 - 0.43 * y6 + 0.69 * y7,
            bound - 1.81 * y7,
            -bound + 1.81 * y7,
        )

    return rhs


def robertson_field(ops: Operations) -> Field:
    def rhs(y, p):
        slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        return back - slow, slow - back - fast, fast

    return rhs


def robertson_dae_field(ops: Operations) -> Field:
    def rhs(y, p):
        slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        return back - slow, slow - back - fast, y[0] + y[1] + y[2] - 1.0

    return rhs


def stiff_van_der_pol_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1], 1e6 * ((1 - y[0] * y[0]) * y[1] - y[0])

    return rhs


def van_der_pol_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1], (1 - y[0] * y[0]) * y[1] - y[0]

    return rhs


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


def rigid_body_field(ops: Operations) -> Field:
    def rhs(y, p):
        return y[1] * y[2], -y[2] * y[0], -0.51 * y[0] * y[1]

    return rhs


_ROBERTSON = (0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050)

CLASSICAL = {
    # [IVP] part II, problem HIRES.
    "hires": Classical(
        Problem("HIRES", hires_field, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057), 321.8122),
        (
            0.7371312573325668e-3,
            0.1442485726316185e-3,
            0.5888729740967575e-4,
            0.1175651343283149e-2,
            0.2386356198831331e-2,
            0.6238968252742796e-2,
            0.2849998395185769e-2,
            0.2850001604814231e-2,
        ),
        stiff=True,
    ),
    # [IVP] part II, problem Robertson.
    "robertson": Classical(Problem("Robertson", robertson_field, (1.0, 0.0, 0.0), 1e11), _ROBERTSON, stiff=True),
    # [IVP] part II, problem van der Pol: epsilon = 1e-6.
    "stiff-van-der-pol": Classical(
        Problem("stiff van der Pol", stiff_van_der_pol_field, (2.0, 0.0), 2.0),
        (0.1706167732170483e1, -0.8928097010247975),
        stiff=True,
    ),
    # [DETEST] problem E2.
    "van-der-pol": Classical(
        Problem("van der Pol", van_der_pol_field, (2.0, 0.0), 20.0),
        (2.008149762174948, -4.250887527320057e-2),
        stiff=False,
    ),
    # [IVP] part II, problem Pleiades; [HNW] section II.10.
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
        stiff=False,
    ),
    # [HNW] section II.0: the orbit closes after one period.
    "arenstorf": Classical(
        Problem(
            "Arenstorf",
            arenstorf_field,
            (0.994, 0.0, 0.0, -2.00158510637908252240537862224),
            17.0652165601579625588917206249,
        ),
        (0.994, 0.0, 0.0, -2.00158510637908252240537862224),
        stiff=False,
    ),
    # [DETEST] problem B5: Euler's equations without torque.
    "rigid-body": Classical(
        Problem("rigid body", rigid_body_field, (0.0, 1.0, 1.0), 20.0),
        (-9.396570798729192e-01, -3.421177754000779e-01, 7.414126596199957e-01),
        stiff=False,
    ),
}

# Robertson's kinetics with the conservation of mass as its third, algebraic, equation.
ROBERTSON_DAE = Classical(
    Problem(
        "Robertson as a DAE",
        robertson_dae_field,
        (1.0, 0.0, 0.0),
        1e11,
        parameters=None,
        mass_form=MassForm((1.0, 1.0, 0.0), ()),
    ),
    _ROBERTSON,
    stiff=True,
)
