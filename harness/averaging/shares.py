"""From errors of random bodies to answers: from which St an error is met, exponents, what estimates are worth.

`at` gives frames their columns. A row is a run of one body at one St by one form, up to one slow time.
"slow" is its error of L and E over I_max, "turned" its error of the orientation in rad. "uncertainty" and
"turned_uncertainty" say how far the reference may be off. "bound" and "turned_bound" are the upper ends
that `solve` states. An "exponent" is the power of St with which an error grows, below 0 as it falls.
`docs/second-order.md` has the theory.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, isnan, log10, nan
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from polhode.harness.answers.averaging_laws import ORDER_ONE, ORDER_TWO, ORDERS
from polhode.harness.averaging.bodies import KINDS
from polhode.harness.averaging.random_study import STUDIED_SLOW_TIMES, Data, Frame
from polhode.harness.common.fits import median_interval, quantile_ranks, wilson

HYBRID = "hybrid"
# The order of averaging by form: rows are grouped by it. Form `hybrid` is a group of its own.
_ORDERS = {**ORDERS, HYBRID: HYBRID}
# Exponents of St by theory, by order of averaging. At a crossing of L² = 2EI₂ the jump decides.
THEORY = {ORDER_ONE: -1.0, ORDER_TWO: -2.0}
CROSSING_EXPONENT = -0.5
_RESONANCE = -0.5  # Of both orders, which leave out the kicks of resonances.
_ORIENTATION = -1.0  # The orientation's, by second order, which alone gives it.
# Errors of L and E over I_max of which the tables say from which St on they are met: one for each power of ten.
ERRORS_MET = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
# Columns of errors, and of the uncertainty of the reference that each was taken against.
UNCERTAINTIES = {"slow": "uncertainty", "turned": "turned_uncertainty"}
# An error of 0 counts as this, so that its logarithm stays finite.
_NO_ERROR = 1e-99
# Shares of the bodies: the median, and the share of the runs whose errors `solve` says to bound.
SHARES = (0.5, 0.975)
# Fewer bodies at one St say too little of a share of 97.5 %. An estimate: of fewer than 40 bodies the largest
# error stands for that share.
LEAST_BODIES = 20
# An error counts as known from this multiple of its reference's uncertainty on: the uncertainty
# changes it by a tenth at most.
KNOWN = 10.0
# Share of the bodies at the larger St whose errors must be known for an exponent. If fewer errors are known, these
# are the largest ones, which fall most slowly with St. An estimate.
LEAST_KNOWN = 0.5
# The errors at the St on either side make an error expected. One that is smaller than this share of it is
# small by cancellation: terms of the error happen to add up to little at that St. An estimate: with half of it
# the page would list fewer such errors. `texts/accuracy-findings.md` says "a third".
CANCELLED = 1 / 3
# St from which on errors are looked at for cancellation: below, no power law holds yet. An estimate.
_CANCELLATION_FROM = 1000.0
# An interval of an exponent that ends this near to the exponent of theory counts as one that holds it. An
# estimate: at a finite St an exponent still differs a little from its limit.
EXPONENT_SLACK = 0.03
# St from which on statements of first and second order are counted: below, a full run confirms them.
STATED_FROM = 1e4
# Nothing is extrapolated to St above the largest one measured.
LARGEST_STOKES = 1e8
# Exponents are fitted to errors of L and E over I_max, or of the orientation in rad, below this one: larger
# errors follow no power law. An estimate.
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


class Needed(NamedTuple):
    """The smallest St from which on a share of the bodies meets an error, and where that comes from."""

    stokes: float  # NaN where no St is known
    # "measured": interpolated between two St; "at most": already at the smallest; "extrapolated": from the
    # largest St on, by an exponent of theory; "beyond": that gives more than LARGEST_STOKES; "never": too many
    # bodies are refused.
    source: str
    # Ends of its interval at 95 %, which counts the bodies and how far references may be off. The upper one is
    # NaN where there are too few bodies to give one.
    low: float
    high: float


_UNKNOWN = Needed(nan, "never", nan, nan)


@dataclass(frozen=True)
class Quantile:
    """The error that a share of a kind's bodies stays below, by St."""

    share: float
    stokes: tuple[float, ...]  # in growing order
    error: tuple[float, ...]  # inf where too many bodies are refused
    bodies: tuple[int, ...]  # how many there are at each St
    # Ends of the error's interval at 95 %, moved by the uncertainty of references. The upper one is NaN where
    # there are too few bodies to give one.
    low: tuple[float, ...]
    high: tuple[float, ...]

    def needed(self, target: float, exponent: float | None) -> Needed:
        """From which St on the share meets an error; nothing is extrapolated without an exponent."""
        stokes, source = _met_from(self.stokes, self.error, target, exponent)
        low, _ = _met_from(self.stokes, self.low, target, exponent)
        bounded = [place for place, error in enumerate(self.high) if not isnan(error)]
        high = nan
        if bounded:
            there = tuple(self.stokes[place] for place in bounded)
            high, _ = _met_from(there, tuple(self.high[place] for place in bounded), target, None)
        return Needed(stokes, source, low, high)


def _met_from(
    stokes: Sequence[float], errors: Sequence[float], target: float, exponent: float | None
) -> tuple[float, str]:
    """Smallest St from which on errors, by ascending St, meet a target, and its source (`Needed.source`)."""
    # Places of the St at which the error is missed; the last one decides.
    missed_at = [place for place, error in enumerate(errors) if error > target]
    if not missed_at:
        return stokes[0], "at most"
    last = missed_at[-1]
    if last + 1 == len(errors):
        if errors[last] == inf:
            return nan, "never"
        if exponent is None:
            return nan, "beyond"
        further = stokes[-1] * (errors[-1] / target) ** (-1 / exponent)
        return (further, "extrapolated") if further <= LARGEST_STOKES else (nan, "beyond")
    if errors[last] == inf:
        return stokes[last + 1], "measured"
    # Logarithms of St and error are interpolated from the last miss to the next St, which meets it.
    missed = log10(errors[last])
    met = log10(max(errors[last + 1], _NO_ERROR))
    fraction = (missed - log10(target)) / (missed - met)
    begin = log10(stokes[last])
    end = log10(stokes[last + 1])
    return 10 ** (begin + fraction * (end - begin)), "measured"


def quantile(runs: Frame, share: float, column: str = "slow") -> Quantile | None:
    """The quantile of a column over the rows of one kind and form, by St; None if no St has LEAST_BODIES.

    The column is "slow" or "turned".
    """
    stokes_numbers = []
    errors = []
    lows = []
    highs = []
    counts = []
    for stokes, stokes_runs in runs.groupby("stokes"):
        count = len(stokes_runs)
        if count < LEAST_BODIES:
            continue
        # A body that the form refuses has no error, and counts as one that meets none.
        values = stokes_runs[column].fillna(inf)
        uncertain = stokes_runs[UNCERTAINTIES[column]]
        first, last = quantile_ranks(share, count)
        # For type checkers the key of a group is any value; its text can become a float.
        stokes_numbers.append(float(str(stokes)))
        errors.append(float(np.sort(values)[ceil(share * count) - 1]))
        lows.append(float(np.sort(np.maximum(0.0, values - uncertain))[max(1, first) - 1]))
        highs.append(float(np.sort(values + uncertain)[last - 1]) if last <= count else nan)
        counts.append(count)
    if not stokes_numbers:
        return None
    columns = (stokes_numbers, errors, counts, lows, highs)
    return Quantile(share, *(tuple(values) for values in columns))


@dataclass(frozen=True)
class Exponent:
    """How an error falls from one St to another: the median over bodies of its exponent, and the interval."""

    kind: str
    order: str
    crosses: bool
    error: str  # "slow" or "turned"
    begin: float  # the two St
    end: float
    bodies: int  # whose errors are known at both
    of: int  # bodies that were measured at the larger St
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
        return self.low - EXPONENT_SLACK <= high and low <= self.high + EXPONENT_SLACK


def exponents(runs: Frame, ends: Sequence[float]) -> list[Exponent]:
    """Exponents of every kind and order between neighbouring St of a sequence, by bodies.

    Left out are errors that the reference does not know; errors above MAX_ERROR_OF_LAWS; the orientation after
    strong resonances, whose kicks spoil it; and St at which less than LEAST_KNOWN of the errors are known.
    """
    rows = []
    averaged = runs[runs["order"].isin(THEORY)]
    for (kind, order, crosses), group in averaged.groupby(["kind", "order", "crosses"]):
        for error, uncertainty in UNCERTAINTIES.items():
            if error == "turned" and kind == "resonance":
                continue
            known = group[group[error].between(KNOWN * group[uncertainty], MAX_ERROR_OF_LAWS)]
            table = known.pivot(index="body", columns="stokes", values=error)
            for begin, end in pairwise(ends):
                slopes = slopes_between(table, begin, end)
                measured = int(np.sum(group["stokes"] == end))
                if slopes is None or len(slopes) < LEAST_KNOWN * measured:
                    continue
                middle, low, high = median_interval(slopes)
                rows.append(
                    Exponent(
                        kind=str(kind),
                        order=str(order),
                        crosses=bool(crosses),
                        error=error,
                        begin=begin,
                        end=end,
                        bodies=len(slopes),
                        of=measured,
                        median=middle,
                        low=low,
                        high=high,
                    )
                )
    return rows


def slopes_between(table: Frame, begin: float, end: float) -> np.ndarray | None:
    """Exponents of the bodies whose errors a table has at two St; None if there are too few."""
    if begin not in table or end not in table:
        return None
    slopes = (np.log10(table[end] / table[begin]) / log10(end / begin)).dropna()
    return slopes.to_numpy() if len(slopes) >= LEAST_BODIES else None


def predicted(row: Exponent) -> tuple[float, float]:
    """The two exponents between which theory puts a measured one.

    Crossings (first order) and resonances (both orders) add an error that falls like 1/√St: as St
    grows, the exponent goes from the order's own to -½. At second order, whose own error falls so fast,
    the weak resonances of bodies of kind "stays" do so too.
    """
    if row.error == "turned":
        return _ORIENTATION, _ORIENTATION
    order_exponent = THEORY[row.order]
    if row.order == ORDER_ONE and row.crosses:
        return order_exponent, CROSSING_EXPONENT
    if row.kind == "resonance" or (row.kind == "stays" and row.order == ORDER_TWO):
        return order_exponent, _RESONANCE
    return order_exponent, order_exponent


@dataclass(frozen=True)
class Bounded:
    """How often what a form states bounds the error: over runs and over bodies.

    A run is one of a body at one St, by `hybrid` to one requested error. It is bounded if what is stated up to
    each slow time bounds the error up to that time.
    """

    kind: str
    order: str
    error: str  # "slow" or "turned"
    runs: int
    missed: int  # runs whose error exceeds the bound up to some slow time
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
        """Whether the share of bounded runs is as large as `solve` claims."""
        return self.share >= SHARES[-1]

    @property
    def interval(self) -> tuple[float, float]:
        """Interval at 95 % of the share of bodies all of whose runs are bounded."""
        return wilson(self.held, self.bodies)


def bounded(runs: Frame) -> list[Bounded]:
    """Stated bounds of every kind and order against the errors measured.

    An error or bound below the reference's uncertainty counts as the uncertainty.
    """
    rows = []
    # At smaller St first and second order are compared with a full run, so that nothing can fail.
    runs = runs[(runs["stokes"] >= STATED_FROM) | (runs["order"] == HYBRID)]
    for error, bound, uncertainty in (
        ("slow", "bound", "uncertainty"),
        ("turned", "turned_bound", "turned_uncertainty"),
    ):
        stated = runs[runs[bound].notna() & runs[error].notna()]
        for (kind, order), group in stated.groupby(["kind", "order"]):
            known_error = np.maximum(group[error], group[uncertainty])
            known_bound = np.maximum(group[bound], group[uncertainty])
            misses = group[error] > known_bound
            # pandas leaves out groups of NaN: of first and second order nothing is requested.
            runs_of = [group["body"], group["stokes"], group["requested"].fillna(0.0)]
            missed_by_run = misses.groupby(runs_of).any()
            missed_by_body = misses.groupby(group["body"]).any()
            rows.append(
                Bounded(
                    kind=str(kind),
                    order=str(order),
                    error=error,
                    runs=len(missed_by_run),
                    missed=int(missed_by_run.sum()),
                    bodies=len(missed_by_body),
                    held=int((~missed_by_body).sum()),
                    worst=float((group[error] / known_bound).max()),
                    over=float((group[bound] / known_error).median()),
                )
            )
    return rows


@dataclass(frozen=True)
class Cancelled:
    """A body whose error at one St is far below what its neighbours make expect."""

    kind: str
    body: int
    order: str
    stokes: tuple[float, float, float]  # the St, between its neighbours
    error: tuple[float, float, float]  # of L and E over I_max, at these St
    ratio: float  # of the middle error to the one expected


def cancelled(runs: Frame) -> tuple[list[Cancelled], int]:
    """The errors that are small by cancellation, the most striking first, and how many errors were looked at."""
    rows = []
    count = 0
    averaged = runs[runs["order"].isin(THEORY) & (runs["slow"] > KNOWN * runs["uncertainty"])]
    averaged = averaged[averaged["stokes"] >= _CANCELLATION_FROM].sort_values("stokes")
    for (kind, body, order), group in averaged.groupby(["kind", "body", "order"]):
        stokes = group["stokes"].to_numpy()
        error = group["slow"].to_numpy()
        # Each St that has neighbours on both sides.
        for middle in range(1, len(stokes) - 1):
            count += 1
            three = slice(middle - 1, middle + 2)
            ratio = _over_expected(stokes[three], error[three])
            if ratio < CANCELLED:
                rows.append(
                    Cancelled(
                        kind=str(kind),
                        body=int(str(body)),
                        order=str(order),
                        stokes=tuple(stokes[three].tolist()),
                        error=tuple(error[three].tolist()),
                        ratio=ratio,
                    )
                )
    return sorted(rows, key=lambda row: row.ratio), count


def _over_expected(stokes: np.ndarray, error: np.ndarray) -> float:
    """The middle one of three errors over the one that the power law through the other two makes expected."""
    begin, middle, end = np.log(stokes)
    first, second, third = np.log(error)
    expected = np.interp(middle, [begin, end], [first, third])
    return float(np.exp(second - expected))


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
    """Median seconds of a form's runs, by St; of `hybrid` those for one requested error."""
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
    """The value that lies nearest to an St by ratio."""
    return min(values, key=lambda value: abs(log10(value / stokes)))


def needed(runs: Frame, kind: str, order: str, share: float, target: float) -> Needed:
    """St from which a share of a kind meets an error of L and E by an order."""
    return all_needed(runs, kind, order, share, (target,))[0]


def all_needed(
    runs: Frame,
    kind: str,
    order: str,
    share: float,
    targets: Sequence[float],
    column: str = "slow",
) -> list[Needed]:
    """The answers of `needed` to several errors, of L and E ("slow") or of the orientation ("turned")."""
    there = runs[(runs["kind"] == kind) & (runs["order"] == order)]
    errors = quantile(there, share, column)
    if errors is None:
        return [_UNKNOWN for _ in targets]
    exponent: float | None = THEORY[order]
    if column == "turned":
        # Kicks of resonances turn the body ever further as St grows.
        exponent = None if kind == "resonance" else _ORIENTATION
    elif kind == "resonance":
        exponent = _RESONANCE
    elif order == ORDER_ONE and 2 * there["crosses"].mean() > 1:
        # The exponent of the law that most of the bodies follow.
        exponent = CROSSING_EXPONENT
    return [errors.needed(target, exponent) for target in targets]
