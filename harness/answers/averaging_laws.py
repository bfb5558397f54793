"""Laws of the error of averaging, read from the study over random bodies (`polhode accuracy`).

A law says that an error falls like a power of 1/St: error = factor / St^power. The file beside this
module has the powers ("exponents", of St), the factors ("few" and "most"), and the St from which errors
are met ("from"). It is the study's `laws.json`; `polhode accuracy --fit` writes it anew, by
`polhode.harness.averaging.laws`.
"""

import json
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

LAWS_FILE = Path(__file__).with_name("averaging_laws.json")
# Names of the laws in the file: by the order of averaging, and of first order for runs that cross
# L² = 2EI₂.
ORDER_ONE = "first order"
ORDER_TWO = "second order"
FIRST_CROSSING = f"{ORDER_ONE}, crossing"
# Order of averaging by the name of a form that averages its whole run; `hybrid` averages parts.
ORDERS = {
    "averaged": ORDER_ONE,
    "averaged-spheroid": ORDER_ONE,
    "averaged-second-order": ORDER_TWO,
}
# A key of the laws beside the names of the orders. Its entry says from which St on second order meets errors of the
# orientation.
TURNED = f"{ORDER_TWO}, orientation"
# Place of the St of 97.5 % of the bodies in an entry of "from" (`polhode.harness.averaging.laws.laws_of`).
_MOST = 1
# St from which on a law is evaluated: below, and at St = 0, its error is as good as infinite.
_LEAST_STOKES = 1e-99


@cache
def _laws() -> dict[str, Any]:
    """The contents of the file, read once."""
    return json.loads(LAWS_FILE.read_text(encoding="utf-8"))


def power(order: str, crosses: bool = False) -> float:
    """Power of 1/St with which the error of an order of averaging falls.

    Theory says 1 for first order, ½ if the run `crosses` L² = 2EI₂, and 2 for second order. The fit
    takes less where errors were measured to fall more slowly, and never more.
    """
    name = FIRST_CROSSING if crosses and order == ORDER_ONE else order
    return -_laws()["exponents"][name]


def few_error(order: str, stokes: float) -> float:
    """Error of L and E, over I_max, that 97.5 % of the study's runs by an order exceed.

    The runs are those over random bodies, to any of the study's slow times.
    """
    return _laws()["few"][order] / max(stokes, _LEAST_STOKES) ** power(order)


def most_error(order: str, stokes: float) -> float:
    """Error of L and E, over I_max, that 97.5 % of the study's bodies stay below by an order.

    It is the error at the largest slow time of the study, t₂ = 1.
    """
    return _laws()["most"][order] / max(stokes, _LEAST_STOKES) ** power(order)


def met_from(name: str, kind: str, error: float) -> float:
    """St from which on 97.5 % of the study's bodies of a kind meet an error by averaging; inf if none is known.

    The name is ORDER_ONE or ORDER_TWO for an error of L and E over I_max, TURNED for one of the orientation in
    rad; the error is a power of ten, from 0.1 to 1e-8.
    """
    stokes = _laws()["from"][name][kind][f"{error:g}"][_MOST]
    return inf if stokes is None else stokes
