"""Exponents and thresholds that `solve`, `pick` and sweeps take from the study over random bodies.

`laws_of` makes them from the study's tables. `polhode.harness.answers.averaging_laws` reads them, and
says what a law is. The columns of frames are those of `polhode.harness.averaging.shares`.
"""

import json
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np

from polhode.harness.answers.averaging_laws import FIRST_CROSSING, LAWS_FILE
from polhode.harness.averaging.random_study import STUDIED_SLOW_TIMES, Data, Frame
from polhode.harness.averaging.shares import (
    CROSSING_EXPONENT,
    ERRORS_MET,
    KNOWN,
    MAX_ERROR_OF_LAWS,
    ORDER_ONE,
    ORDER_TWO,
    SHARES,
    THEORY,
    all_times,
    at,
    kinds_in,
    needed,
    slopes_between,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.fits import median_interval

# Laws by name: of an order, and whether its bodies cross L² = 2EI₂.
_NAMES = {
    ORDER_ONE: (ORDER_ONE, False),
    FIRST_CROSSING: (ORDER_ONE, True),
    ORDER_TWO: (ORDER_TWO, False),
}
# An exponent is measured over a ratio of St this large, the last one that has enough bodies: there
# the law has set in, and both ends are far enough apart.
_RATIO = 10.0
# St from which on an error's multiple of 1/St or 1/St² is taken; an estimate of where laws hold.
_SETTLED_FROM = 1e4


def laws_of(data: Data) -> dict[str, Any]:
    """Exponents of St, errors times their power of St, and the St from which errors are met, by kind.

    Keys: "exponents" of each law, the ones to use; "measured", what they were measured as; "few" and
    "most", factors of a law that 2.5 % and 97.5 % of the errors stay below; "from", by order, kind and
    error, the St from which on half and 97.5 % of the bodies meet it, None where that is unknown.
    """
    runs = at(data, STUDIED_SLOW_TIMES[-1])
    # Kicks of resonances fall more slowly than second order's own error.
    lawful = runs[(runs["order"] == ORDER_ONE) | (runs["kind"] != "resonance")]
    laws: dict[str, Any] = {"exponents": {}, "measured": {}, "few": {}, "most": {}}
    for name, (order, crosses) in _NAMES.items():
        theory = CROSSING_EXPONENT if crosses else THEORY[order]
        own = lawful[(lawful["order"] == order) & (lawful["crosses"] == crosses)]
        measured = _measured(own)
        laws["measured"][name] = measured
        # The measured exponent replaces the exponent of theory if errors fall more slowly. Its upper
        # end counts, so that the law promises no faster fall than was measured.
        slower = measured is not None and measured["low"] > theory
        laws["exponents"][name] = measured["high"] if measured and slower else theory
    # "few" counts runs to every slow time, "most" those to the last one, where errors are largest.
    every = all_times(data)
    for order in THEORY:
        own = every[(every["order"] == order) & (every["stokes"] >= _SETTLED_FROM)]
        own = own[own["slow"] < MAX_ERROR_OF_LAWS]
        if len(own):
            multiples = own["slow"] * own["stokes"] ** -laws["exponents"][order]
            whole = own["slow_time"] == STUDIED_SLOW_TIMES[-1]
            laws["few"][order] = _rounded(float(np.quantile(multiples, 1 - SHARES[-1])))
            laws["most"][order] = _rounded(float(np.quantile(multiples[whole], SHARES[-1])))
    laws["from"] = {}
    for order in THEORY:
        laws["from"][order] = {}
        for kind in kinds_in(runs):
            ends = {}
            for target in ERRORS_MET:
                both = [needed(runs, kind, order, share, target) for share in SHARES]
                ends[f"{target:g}"] = [
                    None if isnan(stokes) else _rounded(stokes) for stokes, _ in both
                ]
            laws["from"][order][kind] = ends
    return laws


def write_laws(laws: dict[str, Any], path: Path = LAWS_FILE) -> None:
    """Write laws into a file; by default the one that `solve`, `pick` and sweeps read."""
    write_file(path, json.dumps(laws, indent=1, ensure_ascii=False) + "\n")


def _measured(runs: Frame) -> dict[str, float] | None:
    """Exponent of the largest St that enough bodies have, over a ratio of ten: median over bodies, and its interval."""
    known = runs[runs["slow"].between(KNOWN * runs["uncertainty"], MAX_ERROR_OF_LAWS)]
    table = known.pivot(index=["kind", "body"], columns="stokes", values="slow")
    for end in sorted(table.columns, reverse=True):
        begin = end / _RATIO
        slopes = slopes_between(table, begin, end)
        if slopes is not None:
            middle, low, high = median_interval(slopes)
            numbers = {"median": middle, "low": low, "high": high}
            rounded = {name: round(value, 3) for name, value in numbers.items()}
            return {"begin": float(begin), "end": float(end), "bodies": len(slopes), **rounded}
    return None


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")
