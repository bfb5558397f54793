"""From errors of random bodies to answers: from which St an error is met, exponents, what estimates are worth.

Frames have the columns that `at` gives them: a row is a run of one body at one St by one form, up to
one slow time. "slow" is its error of L and E over I_max, "turned" that of the orientation in rad;
"uncertainty" and "turned_uncertainty" are how far the reference may be off; "bound" and
"turned_bound" are what `solve` states as upper ends. An "exponent" is the power of St with which an
error grows, below 0 as it falls. `docs/second-order.md` has the theory.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, isnan, log10, nan
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.answers.averaging_laws import ORDER_ONE, ORDER_TWO, ORDERS
from polhode.harness.averaging.bodies import KINDS
from polhode.harness.averaging.random_study import STUDIED_SLOW_TIMES, Data, Frame
from polhode.harness.common.fits import median_interval, wilson

HYBRID = "hybrid"
# The order of averaging of each form, by which rows are grouped; `hybrid` stands for itself.
_ORDERS = {**ORDERS, HYBRID: HYBRID}
# Exponents of St by theory, by order of averaging. At a crossing of L² = 2EI₂ the jump decides.
THEORY = {ORDER_ONE: -1.0, ORDER_TWO: -2.0}
CROSSING_EXPONENT = -0.5
_RESONANCE = -0.5  # Of both orders, which leave out the kicks.
_ORIENTATION = -1.0  # Of second order, which alone gives the orientation.
# Errors of which the tables say from which St on they are met.
ERRORS_MET = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
# Shares of the bodies: the median, and the share that `solve` claims for the errors that it states.
SHARES = (0.5, 0.975)
# Fewer bodies at a St say nothing of a share of 97.5 %; an estimate.
LEAST_BODIES = 20
# An error counts as known from this multiple of its reference's uncertainty on: the uncertainty
# changes it by a tenth at most.
KNOWN = 10.0
# An error smaller than this share of what those at the St on either side make expect is one by
# cancellation: terms of the error happen to add up to little at that St. The share is an estimate.
CANCELLED = 1 / 3
# St from which on errors are looked at for cancellation: below, no power law holds yet.
_FROM = 1000.0
# An interval that ends this near to the exponent of theory counts as one that holds it; an estimate.
_NEAR = 0.03
# St from which on statements of first and second order are counted: below, a full run confirms them.
STATED_FROM = 1e4
# Nothing is extrapolated to larger St.
LARGEST_STOKES = 1e8
# Exponents are fitted to errors below this one: larger ones follow no power law. An estimate.
MAX_ERROR_OF_LAWS = 0.1


def at(data: Data, slow_time: float) -> Frame:
    """Every run's errors and statements up to one slow time, with what is known of its body and its reference."""
    suffix = f"_{slow_time:g}"
    keys = ["kind", "body", "stokes"]
    names = ("slow", "turned", "bound", "turned_bound")
    columns = {f"{name}{suffix}": name for name in names}
    plain = [*keys, "form", "requested", "solver_error", "seconds", "refused"]
    runs = data.errors[[*plain, *columns]].rename(columns=columns)
    references = data.references[[*keys, f"slow{suffix}", f"turned{suffix}"]]
    references = references.rename(
        columns={f"slow{suffix}": "uncertainty", f"turned{suffix}": "turned_uncertainty"}
    )
    runs = runs.merge(references, on=keys)
    runs = runs.merge(data.bodies[["kind", "body", "crossing", "kick"]], on=["kind", "body"])
    runs["order"] = runs["form"].map(_ORDERS)
    runs["crosses"] = runs["crossing"] < slow_time
    runs["slow_time"] = slow_time
    return runs


@dataclass(frozen=True)
class Quantile:
    """The error that a share of a kind's bodies stays below, by St."""

    share: float
    stokes: tuple[float, ...]  # in growing order
    error: tuple[float, ...]  # inf where too many bodies are refused
    bodies: tuple[int, ...]  # how many there are at each St

    def needed(self, target: float, exponent: float) -> tuple[float, str]:
        """Smallest St from which on the share meets an error, and where that comes from.

        "measured": interpolated between two St; "at most": already at the smallest; "extrapolated":
        from the largest St on, by an exponent of theory; "beyond": that gives more than
        LARGEST_STOKES; "never": too many bodies are refused.
        """
        # Places of the St at which the error is missed; the last one decides.
        above = [i for i, error in enumerate(self.error) if error > target]
        if not above:
            return self.stokes[0], "at most"
        last = above[-1]
        if self.error[last] == inf and last + 1 == len(self.error):
            return nan, "never"
        if last + 1 == len(self.error):
            stokes = self.stokes[-1] * (self.error[-1] / target) ** (-1 / exponent)
            return (stokes, "extrapolated") if stokes <= LARGEST_STOKES else (nan, "beyond")
        if self.error[last] == inf:
            return self.stokes[last + 1], "measured"
        low, high = log10(self.error[last + 1]), log10(self.error[last])
        way = (high - log10(target)) / (high - low)
        begin, end = log10(self.stokes[last]), log10(self.stokes[last + 1])
        return 10 ** (begin + way * (end - begin)), "measured"


def quantile(runs: Frame, share: float, column: str = "slow") -> Quantile | None:
    """The quantile of one kind and form, over the St with enough bodies; None without any."""
    stokes, errors, counts = [], [], []
    for number, there in runs.groupby("stokes"):
        if len(there) < LEAST_BODIES:
            continue
        # A body that the form refuses has no error, and counts as one that meets none.
        ordered = np.sort(there[column].fillna(inf))
        stokes.append(float(str(number)))
        errors.append(float(ordered[ceil(share * len(ordered)) - 1]))
        counts.append(len(ordered))
    return Quantile(share, tuple(stokes), tuple(errors), tuple(counts)) if stokes else None


@dataclass(frozen=True)
class Exponent:
    """How an error falls from one St to another: the median over bodies of its exponent, and the interval."""

    kind: str
    order: str
    crosses: bool
    error: str  # "slow" or "turned"
    begin: float  # the two St
    end: float
    bodies: int
    median: float
    low: float  # ends of the 95 % interval of the median
    high: float

    @property
    def width(self) -> float:
        """Half the interval's width."""
        return (self.high - self.low) / 2

    @property
    def agrees(self) -> bool:
        """Whether the interval holds an exponent of theory, or nearly so."""
        low, high = predicted(self)
        return self.low - _NEAR <= high and low <= self.high + _NEAR


def exponents(runs: Frame, ends: Sequence[float]) -> list[Exponent]:
    """Exponents of every kind and order between neighbouring St of a sequence, by bodies.

    Left out are errors that the reference does not know, those above MAX_ERROR_OF_LAWS, and the
    orientation after strong resonances, whose kicks spoil it.
    """
    rows = []
    errors = {"slow": "uncertainty", "turned": "turned_uncertainty"}
    averaged = runs[runs["order"].isin(THEORY)]
    for (kind, order, crosses), group in averaged.groupby(["kind", "order", "crosses"]):
        for error, uncertainty in errors.items():
            if error == "turned" and kind == "resonance":
                continue
            known = group[group[error].between(KNOWN * group[uncertainty], MAX_ERROR_OF_LAWS)]
            table = known.pivot(index="body", columns="stokes", values=error)
            for begin, end in pairwise(ends):
                slopes = slopes_between(table, begin, end)
                if slopes is None:
                    continue
                of = str(kind), str(order), bool(crosses), error
                place = begin, end, len(slopes)
                rows.append(Exponent(*of, *place, *median_interval(slopes)))
    return rows


def slopes_between(table: Frame, begin: float, end: float) -> np.ndarray | None:
    """Exponents of the bodies whose errors a table has at two St; None if there are too few."""
    if begin not in table or end not in table:
        return None
    slopes = (np.log10(table[end] / table[begin]) / log10(end / begin)).dropna()
    return slopes.to_numpy() if len(slopes) >= LEAST_BODIES else None


def predicted(row: Exponent) -> tuple[float, float]:
    """The exponents between which theory puts this one.

    Crossings (first order) and resonances (both orders) add an error that falls like 1/√St: as St
    grows, the exponent goes from the order's own to -½.
    """
    if row.error == "turned":
        return _ORIENTATION, _ORIENTATION
    own = THEORY[row.order]
    if row.order == ORDER_ONE and row.crosses:
        return own, CROSSING_EXPONENT
    if row.kind == "resonance":
        return own, _RESONANCE
    return own, own


@dataclass(frozen=True)
class Bounded:
    """How often what a form states bounds the error: over runs and over bodies."""

    kind: str
    order: str
    error: str
    runs: int
    missed: int
    bodies: int
    held: int  # bodies all of whose runs are bounded
    worst: float  # largest error over bound
    over: float  # median of bound over error

    @property
    def share(self) -> float:
        """Share of the runs that are bounded."""
        return 1 - self.missed / self.runs

    @property
    def enough(self) -> bool:
        """Whether that is as large as `solve` claims."""
        return self.share >= SHARES[-1]

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the share of bodies."""
        return wilson(self.held, self.bodies)


def bounded(runs: Frame) -> list[Bounded]:
    """Statements of every kind and order against the errors measured; an error below the uncertainty counts as that."""
    rows = []
    # At smaller St first and second order are compared with a full run, so that nothing can fail.
    runs = runs[(runs["stokes"] >= STATED_FROM) | (runs["order"] == HYBRID)]
    for error, bound, uncertainty in (
        ("slow", "bound", "uncertainty"),
        ("turned", "turned_bound", "turned_uncertainty"),
    ):
        stated = runs[runs[bound].notna() & runs[error].notna()]
        for (kind, order), group in stated.groupby(["kind", "order"]):
            least = np.maximum(group[error], group[uncertainty])
            misses = group[error] > np.maximum(group[bound], group[uncertainty])
            by_body = misses.groupby(group["body"]).any()
            rows.append(
                Bounded(
                    *(str(kind), str(order), error, len(group), int(misses.sum())),
                    *(len(by_body), int((~by_body).sum())),
                    float((group[error] / np.maximum(group[bound], group[uncertainty])).max()),
                    float((group[bound] / least).median()),
                )
            )
    return rows


@dataclass(frozen=True)
class Cancelled:
    """A body whose error at one St is far below what its neighbours make expect."""

    kind: str
    body: int
    order: str
    stokes: tuple[float, float, float]
    error: tuple[float, float, float]
    ratio: float  # of the middle error to the one expected


def cancelled(runs: Frame) -> tuple[list[Cancelled], int]:
    """The errors that are small by cancellation, the most striking first, and of how many."""
    rows = []
    count = 0
    averaged = runs[runs["order"].isin(THEORY) & (runs["slow"] > KNOWN * runs["uncertainty"])]
    for (kind, body, order), group in averaged.groupby(["kind", "body", "order"]):
        group = group[group["stokes"] >= _FROM].sort_values("stokes")
        stokes = group["stokes"].to_numpy()
        error = group["slow"].to_numpy()
        for i in range(1, len(stokes) - 1):
            count += 1
            three = slice(i - 1, i + 2)
            # The middle error by the power law through both neighbours.
            x, y = np.log(stokes[three]), np.log(error[three])
            expected = np.interp(x[1], x[::2], y[::2])
            ratio = float(np.exp(y[1] - expected))
            if ratio < CANCELLED:
                place = tuple(stokes[three].tolist()), tuple(error[three].tolist())
                rows.append(Cancelled(str(kind), int(str(body)), str(order), *place, ratio))
    return sorted(rows, key=lambda row: row.ratio), count


def kinds_in(runs: Frame) -> list[str]:
    """The kinds of a frame, in the order of the study."""
    there = set(runs["kind"])
    return [kind for kind in KINDS if kind in there]


def all_times(data: Data) -> Frame:
    """The runs up to every slow time, one row each."""
    return pd.concat([at(data, slow_time) for slow_time in STUDIED_SLOW_TIMES])


def full_seconds(data: Data, kind: str, target: float) -> dict[float, float]:
    """Median seconds of the cheapest full run that meets an error, by St."""
    runs = data.costs[(data.costs["kind"] == kind) & (data.costs["error"] <= target)]
    return _medians(runs)


def form_seconds(runs: Frame, kind: str, order: str, requested: float = nan) -> dict[float, float]:
    """Median seconds of a form's runs, by St."""
    there = runs[(runs["kind"] == kind) & (runs["order"] == order) & runs["seconds"].notna()]
    if not isnan(requested):
        there = there[there["requested"] == requested]
    return _medians(there)


def _medians(runs: Frame) -> dict[float, float]:
    """By St, the median over bodies of the seconds of each body's fastest run."""
    cheapest = runs.groupby(["stokes", "body"])["seconds"].min()
    medians: Any = cheapest.groupby("stokes").median()
    return {float(stokes): float(seconds) for stokes, seconds in medians.items()}


def nearest(values: Iterable[float], stokes: float) -> float:
    """The St of some that lies nearest to one, by ratio."""
    return min(values, key=lambda value: abs(log10(value / stokes)))


def needed(runs: Frame, kind: str, order: str, share: float, target: float) -> tuple[float, str]:
    """St from which a share of a kind meets an error by an order, and where that comes from (`Quantile.needed`)."""
    there = runs[(runs["kind"] == kind) & (runs["order"] == order)]
    found = quantile(there, share)
    if found is None:
        return nan, "never"
    if kind == "resonance":
        return found.needed(target, _RESONANCE)
    # The law that most of the bodies follow.
    crossing = order == ORDER_ONE and 2 * there["crosses"].mean() > 1
    return found.needed(target, CROSSING_EXPONENT if crossing else THEORY[order])
