"""Kinetics: the stiff problems that codes are known by."""

from polhode.models.operations import Field, Operations
from polhode.models.problem import MassForm, Problem
from polhode.models.problems.classical import DETEST, HNW, IVP, Classical


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


def oregonator_field(ops: Operations) -> Field:
    def rhs(y, p):
        y1, y2, y3 = y[0], y[1], y[2]
        return 77.27 * (y2 + y1 * (1 - 8.375e-6 * y1 - y2)), (y3 - (1 + y1) * y2) / 77.27, 0.161 * (y1 - y3)

    return rhs


def e5_field(ops: Operations) -> Field:
    """In units of 1.76e-3, 1e-9, 1e-11 and 1e-9, so that no component hides below an absolute tolerance."""

    def rhs(y, p):
        decay, meeting, back = 7.89e-10 * y[0], y[0] * y[2], y[1] * y[2]
        return (
            -decay - 1.1e-4 * meeting,
            1.76e6 * decay - 1.13e-2 * back,
            1.76e8 * decay - 19360.0 * meeting - 1.13 * back + 1.13e5 * y[3],
            193.6 * meeting - 1130.0 * y[3],
        )

    return rhs


def brusselator_field(ops: Operations) -> Field:
    def rhs(y, p):
        reaction = y[0] * y[0] * y[1]
        return 1 + reaction - 4 * y[0], 3 * y[0] - reaction

    return rhs


_ROBERTSON = (0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050)

KINETICS = {
    "hires": Classical(
        Problem("HIRES", hires_field, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057), 321.8122),
        (
            *(0.7371312573325668e-3, 0.1442485726316185e-3, 0.5888729740967575e-4, 0.1175651343283149e-2),
            *(0.2386356198831331e-2, 0.6238968252742796e-2, 0.2849998395185769e-2, 0.2850001604814231e-2),
        ),
        True,
        f"{IVP}: HIRES",
    ),
    "robertson": Classical(
        Problem("Robertson", robertson_field, (1.0, 0.0, 0.0), 1e11),
        _ROBERTSON,
        True,
        f"{IVP}: Robertson",
        ("cvode-adams",),
    ),
    # With the conservation of mass as its third, algebraic, equation.
    "robertson-dae": Classical(
        Problem(
            "Robertson as a DAE",
            robertson_dae_field,
            (1.0, 0.0, 0.0),
            1e11,
            parameters=None,
            mass_form=MassForm((1.0, 1.0, 0.0), ()),
        ),
        _ROBERTSON,
        True,
        f"{IVP}: Robertson",
    ),
    "oregonator": Classical(
        Problem("OREGO", oregonator_field, (1.0, 2.0, 3.0), 360.0),
        (0.1000814870318523e1, 0.1228178521549917e4, 0.1320554942846706e3),
        True,
        f"{IVP}: OREGO",
        ("rk45", "dop853"),
    ),
    "e5": Classical(
        Problem("E5", e5_field, (1.0, 0.0, 0.0, 0.0), 1000.0),
        (0.9193619317661504, 0.13822370305188848, 0.8251573500555210, 0.12997212954716940),
        True,
        f"{DETEST}: E5; digits by Taylor in long double",
        ("rk45", "dop853"),
    ),
    "brusselator": Classical(
        Problem("Brusselator", brusselator_field, (1.5, 3.0), 20.0),
        (0.4986370712683478291, 4.596780349452011025),
        False,
        f"{HNW}: section II.4; digits by Mathematica to 32 places (cpmech/russell, russell_ode)",
    ),
}
