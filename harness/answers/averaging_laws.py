"""Laws of the error of averaging, read from the study over random bodies (`polhode accuracy`).

The file beside this module is the study's `laws.json`; `polhode accuracy --fit` writes it anew.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

LAWS_FILE = Path(__file__).with_name("averaging_laws.json")
ORDER_ONE = "first order"
ORDER_TWO = "second order"
FIRST_CROSSING = f"{ORDER_ONE}, crossing"
# Order of the forms that average alone.
ORDERS = {
    "averaged": ORDER_ONE,
    "averaged-spheroid": ORDER_ONE,
    "averaged-second-order": ORDER_TWO,
}


@cache
def _laws() -> dict[str, Any]:
    return json.loads(LAWS_FILE.read_text(encoding="utf-8"))


def power(order: str, crosses: bool = False) -> float:
    """Power of 1/St with which an order's error falls; of first order also after a crossing of L² = 2EI₂.

    No more than theory says: 1, ½ after a crossing, 2 of second order.
    """
    name = FIRST_CROSSING if crosses and order == ORDER_ONE else order
    return -_laws()["exponents"][name]


def few_error(order: str, stokes: float) -> float:
    """Error of L and E, over I_max, that 2.5 % of the study's runs stayed below by an order at a St."""
    return _laws()["few"][order] / max(stokes, 1e-99) ** power(order)


def most_error(order: str, stokes: float) -> float:
    """Error of L and E, over I_max, that 97.5 % of the study's bodies stayed below by an order at a St."""
    return _laws()["most"][order] / max(stokes, 1e-99) ** power(order)
