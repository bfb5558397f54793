"""Exponents and thresholds that `solve`, `pick` and sweeps take from the study over random bodies.

`laws_of` makes them from the study's tables. `polhode.harness.answers.averaging_laws` reads them, and
says what a law is. `polhode.harness.averaging.shares` describes the columns of the frames.
"""

import json
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np

from polhode.harness.answers.averaging_laws import FIRST_CROSSING, LAWS_FILE, TURNED
from polhode.harness.averaging.random_study import STUDIED_SLOW_TIMES, Data, Frame
from polhode.harness.averaging.shares import (
    CROSSING_EXPONENT,
    ERRORS_MET,
    KNOWN,
    LEAST_KNOWN,
    MAX_ERROR_OF_LAWS,
    ORDER_ONE,
    ORDER_TWO,
    SHARES,
    THEORY,
    all_needed,
    all_times,
    at,
    kinds_in,
    slopes_between,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.fits import median_interval

# Laws by name: the order of averaging, and whether the bodies cross L² = 2EI₂.
_NAMES = {
    ORDER_ONE: (ORDER_ONE, False),
    FIRST_CROSSING: (ORDER_ONE, True),
    ORDER_TWO: (ORDER_TWO, False),
}
# Thresholds by name: the order of averaging, and the column of the error (`shares`).
_THRESHOLDS = {
    ORDER_ONE: (ORDER_ONE, "slow"),
    ORDER_TWO: (ORDER_TWO, "slow"),
    TURNED: (ORDER_TWO, "turned"),
}
# An exponent is measured between two St of this ratio, the largest ones that have enough bodies: there the
# law has set in, and the two are far enough apart.
_STOKES_RATIO = 10.0
# St from which on an error's multiple of 1/St or 1/St² is taken. An estimate of where laws hold: from a smaller
# St on, errors that follow no law yet would widen the range between the factors "few" and "most".
_SETTLED_FROM = 1e4
_EXPONENT_DECIMALS = 3  # Of measured exponents: their intervals are wider than 0.001.
_LAW_DIGITS = 2  # Significant digits of factors and thresholds: bodies differ by more than 1 %.


def laws_of(data: Data) -> dict[str, Any]:
    """Exponents of St, errors times their power of St, and the St from which errors are met, by kind.

    Keys: "exponents" has the exponent of each law that is to be used, "measured" what was measured of it.
    "few" and "most" have the factors of a law that 2.5 % and 97.5 % of the errors stay below. "from" has, by
    order, kind and error, four St, each None where unknown. Half of the bodies meet the error from the first on,
    97.5 % from the second on; the third and the fourth are the ends of the second's interval. Errors are of L
    and E, under TURNED of the orientation by second order.
    """
    runs = at(data, STUDIED_SLOW_TIMES[-1])
    measured, exponents = _exponents(runs)
    few, most = _factors(all_times(data), exponents)
    return {
        "exponents": exponents,
        "measured": measured,
        "few": few,
        "most": most,
        "from": {
            name: {kind: _thresholds(runs, kind, order, column) for kind in kinds_in(runs)}
            for name, (order, column) in _THRESHOLDS.items()
        },
    }


def _exponents(runs: Frame) -> tuple[dict[str, dict[str, float] | None], dict[str, float]]:
    """The measured exponent of each law, None where unknown, and the exponent to use, by name."""
    # Kicks of resonances fall more slowly than second order's own error.
    lawful = runs[(runs["order"] == ORDER_ONE) | (runs["kind"] != "resonance")]
    measured = {}
    exponents = {}
    for name, (order, crosses) in _NAMES.items():
        theory = CROSSING_EXPONENT if crosses else THEORY[order]
        exponent = _measured(lawful[(lawful["order"] == order) & (lawful["crosses"] == crosses)])
        measured[name] = exponent
        # The measured exponent replaces the exponent of theory if errors fall more slowly. Its upper
        # end counts, so that the law promises no faster fall than was measured.
        slower = exponent is not None and exponent["low"] > theory
        exponents[name] = exponent["high"] if exponent and slower else theory
    return measured, exponents


def _factors(runs: Frame, exponents: dict[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Factors of each order's law that 2.5 % and 97.5 % of the errors stay below.

    The first counts runs to every slow time, the second runs to the last one, where errors are largest. Bodies
    that cross L² = 2EI₂ count too: who asks for a factor gives an order and St, and no body.
    """
    few = {}
    most = {}
    for order in THEORY:
        lawful = runs[(runs["order"] == order) & (runs["stokes"] >= _SETTLED_FROM)]
        lawful = lawful[lawful["slow"] < MAX_ERROR_OF_LAWS]
        if len(lawful):
            multiples = lawful["slow"] * lawful["stokes"] ** -exponents[order]
            to_the_last = lawful["slow_time"] == STUDIED_SLOW_TIMES[-1]
            few[order] = _rounded(float(np.quantile(multiples, 1 - SHARES[-1])))
            most[order] = _rounded(float(np.quantile(multiples[to_the_last], SHARES[-1])))
    return few, most


def _thresholds(runs: Frame, kind: str, order: str, column: str) -> dict[str, list[float | None]]:
    """Four St by the error in text: from where on half and 97.5 % of a kind meet it, and ends of the latter."""
    half, most = (all_needed(runs, kind, order, share, ERRORS_MET, column) for share in SHARES)
    thresholds: dict[str, list[float | None]] = {}
    for target, of_half, of_most in zip(ERRORS_MET, half, most, strict=True):
        numbers = (of_half.stokes, of_most.stokes, of_most.low, of_most.high)
        thresholds[f"{target:g}"] = [None if isnan(st) else _rounded(st) for st in numbers]
    return thresholds


def write_laws(laws: dict[str, Any], path: Path = LAWS_FILE) -> None:
    """Write laws into a file; by default the one that `solve`, `pick` and sweeps read."""
    write_file(path, json.dumps(laws, indent=1, ensure_ascii=False) + "\n")


def _measured(runs: Frame) -> dict[str, float] | None:
    """Exponent between the two largest St of the ratio `_STOKES_RATIO` at which enough bodies have a known error.

    It is the median over bodies, with its interval at 95 %; None without such St.
    """
    known = runs[runs["slow"].between(KNOWN * runs["uncertainty"], MAX_ERROR_OF_LAWS)]
    table = known.pivot(index=["kind", "body"], columns="stokes", values="slow")
    for end in sorted(table.columns, reverse=True):
        begin = end / _STOKES_RATIO
        slopes = slopes_between(table, begin, end)
        bodies = np.sum(runs["stokes"] == end)
        if slopes is not None and len(slopes) >= LEAST_KNOWN * bodies:
            middle, low, high = median_interval(slopes)
            return {
                "begin": float(begin),
                "end": float(end),
                "bodies": len(slopes),
                "median": round(middle, _EXPONENT_DECIMALS),
                "low": round(low, _EXPONENT_DECIMALS),
                "high": round(high, _EXPONENT_DECIMALS),
            }
    return None


def _rounded(value: float) -> float:
    """A value in `_LAW_DIGITS` significant digits."""
    return float(f"{value:.{_LAW_DIGITS}g}")
