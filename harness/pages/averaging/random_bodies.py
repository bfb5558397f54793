"""The study of averaging over random bodies: for the terminal, as JSON, and as a page with figure and data.

Kinds of bodies are in `bodies.KINDS`, orders of averaging are "first order", "second order" and "hybrid".
`shares` says what the columns of runs mean, `random_study` explains the columns of references.
"""

from collections.abc import Sequence
from dataclasses import asdict
from math import inf, isnan, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from polhode.harness.analysis.frames import rows_of
from polhode.harness.answers.averaging_laws import TURNED
from polhode.harness.averaging import bodies, random_study, shares
from polhode.harness.averaging.bodies import KINDS
from polhode.harness.averaging.laws import laws_of, write_laws
from polhode.harness.averaging.random_study import (
    STUDIED_SLOW_TIMES,
    Data,
    Frame,
    read_data,
    write_data,
)
from polhode.harness.averaging.shares import (
    ERRORS_MET,
    HYBRID,
    ORDER_ONE,
    ORDER_TWO,
    SHARES,
    THEORY,
    Bounded,
    Cancelled,
    Exponent,
    Needed,
    all_needed,
    all_times,
    at,
    bounded,
    cancelled,
    exponents,
    form_seconds,
    full_seconds,
    kinds_in,
    needed,
    predicted,
    quantile,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.fits import least_bodies, wilson
from polhode.harness.common.machine import provenance
from polhode.harness.common.text import aligned, cells, in_two_digits, markdown, short
from polhode.harness.pages.figures.averaging import Band, bands
from polhode.harness.pages.figures.style import save
from polhode.harness.pages.tables import columns_of, fill, lines_of

# The slow time of most tables: the longest that was studied.
WHOLE = STUDIED_SLOW_TIMES[-1]
# Decades of St between which exponents are given: the St of the study (`random_study.BODIES`) that are a
# power of ten, but for the least one. A choice.
_DECADES = (100.0, 1000.0, 1e4, 1e5, 1e6, 1e7, 1e8)
# St from which on the paper calls the averaged equations good, by kind of body: items "spheroid-slow-1", of a prolate
# body (`paper.sections.spheroids`), and "ellipsoid-planes" (`paper.sections.ellipsoids`). For oblate bodies the same
# St is taken as for prolate ones.
_GOOD_FROM = {"prolate": 100.0, "oblate": 100.0, "stays": 1000.0, "crosses": 1000.0}
# Target share of the runs whose error is below the stated one: the upper end of an interval of 95 %.
_BOUNDED = 0.975
# The next six say what the page shows of what was studied. They are choices.
# Error of L and E, over I_max, of the table by slow time.
_SHOWN_TARGET = 1e-3
# St at which the cost of `hybrid` is shown, and the requested error of L and E.
_HYBRID_SHOWN = (1e4, 1e5, 1e6)
_HYBRID_ERROR = 1e-6
# Examples of errors that are small by cancellation (`shares.CANCELLED`).
_EXAMPLES = 3
# Errors of L and E for which a sentence gives the St from which on they are met.
_SENTENCE_TARGETS = (1e-2, 1e-4)
# Columns of `which_form`: a name among the laws' thresholds (`laws.laws_of`), and an error.
_WHICH = (
    (ORDER_ONE, 1e-2),
    (ORDER_ONE, 1e-4),
    (ORDER_TWO, 1e-4),
    (ORDER_TWO, 1e-6),
    (TURNED, 1e-2),
)
# The page says how many bodies an exponent is of if fewer than this share have, at both St, errors that their
# references know and that are below `MAX_ERROR_OF_LAWS`. An estimate.
_ALMOST_ALL = 0.9
# Half the width of an exponent's interval from which on the page says why it is not narrower. An estimate: a fifth of
# the least difference between two exponents of theory, 0.5.
_WIDE = 0.1
# Bodies below which an interval is wide for their number alone. An estimate, between 60 and 200
# (`random_study.BODIES`).
_FEW_BODIES = 100
# Quantiles of a band over the bodies: its lower edge, its line, its upper edge.
_BAND = (0.025, 0.5, 0.975)
# Title of the panel of the orientation.
_ORIENTATION = "orientation (rad)"
# Words for the errors, by column: "turned" is the error of the orientation, in rad.
_ERRORS = {"slow": "L, E", "turned": "orientation"}


def write_page(data: Data, folder: Path, command: str) -> dict[str, Any]:
    """Write the page, its figure and its data into a folder; return the laws that the data show."""
    write_data(data, folder)
    # Numbers in the tables are rounded: read again, they give the same page that others would get of them.
    data = read_data(folder)
    laws = laws_of(data)
    write_laws(laws, folder / "laws.json")
    note = (
        f"{len(data.bodies)} random bodies and starts, {len(data.references)} references; errors are "
        "maxima up to t₂ = 1, of L and E over the largest moment of inertia. Lines: half of the bodies "
        f"stay below; bands: from 2.5 to 97.5 %, where at most 2.5 % are refused; {shares.LEAST_BODIES} "
        "bodies or more at each St. Second order refuses bodies that cross L² = 2EI₂. Orientation: "
        "second order, without resonances."
    )
    # Figures with times name the machine that they were measured on: this one has no times.
    save(bands(_panels(data), note, _refusals(data)), folder, "errors")
    write_file(folder / "README.md", page(data, command, laws))
    return laws


class Analysis(NamedTuple):
    """The common base of tables and findings."""

    runs: Frame  # Errors up to the slow time `WHOLE`.
    exponents: list[Exponent]  # Of the fall of errors, between the St of `_DECADES`.
    bounded: list[Bounded]  # How many runs, up to any slow time, keep to their stated errors.
    # The errors that are small by cancellation, the most striking first, and how many errors were looked at.
    cancelled: tuple[list[Cancelled], int]

    @classmethod
    def of(cls, data: Data) -> "Analysis":
        """The analysis of a study."""
        runs = at(data, WHOLE)
        return cls(
            runs=runs,
            exponents=exponents(runs, _DECADES),
            bounded=bounded(all_times(data)),
            cancelled=cancelled(runs),
        )


def page(data: Data, command: str, laws: dict[str, Any] | None = None) -> str:
    """The report as Markdown; the laws that the data show are computed unless given."""
    analysis = Analysis.of(data)
    runs = analysis.runs
    sentences = findings(data, analysis)
    # These answer from which St on averaging is good: they begin the page. The words are those of
    # `texts/accuracy-findings.md`.
    answers = [line for line in sentences if " meets an error of " in line]
    return fill(
        "accuracy",
        made=provenance(command, [*data.timed.values()]),
        which_form=which_form(laws or laws_of(data)),
        answers=answers,
        findings=[line for line in sentences if line not in answers],
        needed={order: needed_rows(runs, order) for order in (ORDER_ONE, ORDER_TWO)},
        turned=needed_rows(runs, ORDER_TWO, "turned"),
        intervals={
            ORDER_ONE: interval_rows(runs, ORDER_ONE),
            ORDER_TWO: interval_rows(runs, ORDER_TWO),
            TURNED: interval_rows(runs, ORDER_TWO, "turned"),
        },
        largest={order: largest_rows(runs, order) for order in (ORDER_ONE, ORDER_TWO)},
        costs={order: cost_rows(data, runs, order) for order in (ORDER_ONE, ORDER_TWO)},
        hybrid=hybrid_rows(data, runs),
        by_time=time_rows(data),
        exponents=exponent_rows(analysis.exponents),
        runs=runs,
        least=least_bodies(SHARES[-1]),
        prolate=_of_all_and_first(runs),
        wide_from=_WIDE,
        wide=[why_wide(row) for row in analysis.exponents if row.width > _WIDE],
        bounded=[_bounded_row(row) for row in sorted(analysis.bounded, key=_place)],
        cancelled=analysis.cancelled[0][:_EXAMPLES],
        references=reference_rows(data),
        counts=count_rows(data),
        count_columns=[short(stokes) for stokes in sorted(data.references["stokes"].unique())],
        kinds=KINDS,
        study=random_study,
        # If the data are a part of the study: how many references they have, and how many the study has.
        first=random_study.first_references(data),
        every=len(random_study.whole()),
        shares=shares,
        bodies=bodies,
        solver_error=runs["solver_error"],
        target=_SHOWN_TARGET,
        hybrid_error=_HYBRID_ERROR,
    )


def _of_all_and_first(runs: Frame) -> tuple[float, float]:
    """Error times St at St = 1e6 that 97.5 % of prolate bodies stay below by first order: of all, and of the first."""
    there = runs[
        (runs["kind"] == "prolate") & (runs["order"] == ORDER_ONE) & (runs["stokes"] == 1e6)
    ]
    first = there[there["body"] < random_study.BODIES[1e7]]
    of_all, of_first = (quantile(part, SHARES[-1]) for part in (there, first))
    if of_all is None or of_first is None:
        return nan, nan
    return 1e6 * of_all.error[0], 1e6 * of_first.error[0]


def findings(data: Data, analysis: Analysis) -> list[str]:
    """The findings in sentences."""
    runs = analysis.runs
    # By kind of body: the St of the paper, and the errors of first order there, in ascending order.
    good = []
    for kind, stokes in _GOOD_FROM.items():
        kind_runs = runs[
            (runs["kind"] == kind) & (runs["order"] == ORDER_ONE) & (runs["stokes"] == stokes)
        ]
        if len(kind_runs):
            errors = np.sort(kind_runs["slow"].fillna(inf))
            good.append((kind, stokes, errors, len(kind_runs)))
    striking, tried = analysis.cancelled
    return lines_of(
        "accuracy-findings",
        bodies=len(data.bodies),
        kinds=len(kinds_in(data.references)),
        runs=len(data.references),
        largest=data.references["stokes"].max(),
        spans={order: _spans(runs, order) for order in (ORDER_ONE, ORDER_TWO)},
        slower=_slower(data, runs),
        good=good,
        fitted=_against_theory(analysis.exponents),
        bounded=analysis.bounded,
        share=_BOUNDED,
        cancelled=striking,
        tried=tried,
        failures=data.references["failure"].ne("").sum(),
        slack=shares.EXPONENT_SLACK,
    )


def which_form(laws: dict[str, Any]) -> str:
    """Which form when, as a table: from which St on 97.5 % of the bodies of a kind meet an error, with intervals."""
    heads = {}
    for name, target in _WHICH:
        heads[f"{name} to {short(target)}"] = (name, f"{target:g}")
    rows = []
    for kind, text in KINDS.items():
        cells_of_kind = [text]
        for name, target in heads.values():
            thresholds = laws["from"][name].get(kind, {}).get(target, [None] * 4)
            _, most, low, high = (nan if number is None else number for number in thresholds)
            cell = "–"
            if not isnan(most):
                cell = f"{in_two_digits(most)} ({_interval(low, high)})"
            cells_of_kind.append(cell)
        rows.append(cells_of_kind)
    return markdown(["body and start", *heads], rows, right=range(1, len(heads) + 1))


def as_text(data: Data) -> str:
    """The findings, and the tables of the page that answer first, for a terminal."""
    analysis = Analysis.of(data)
    runs = analysis.runs
    parts = ["\n".join(findings(data, analysis))]
    columns = columns_of("accuracy-needed")
    for order in (ORDER_ONE, ORDER_TWO):
        table = aligned([*columns], cells(needed_rows(runs, order), columns))
        parts.append(
            f"{order}: St from which an error is met in half / 97.5 % of the bodies\n{table}"
        )
    return "\n\n".join(parts)


def as_json(data: Data) -> dict[str, Any]:
    """The findings as plain data."""
    analysis = Analysis.of(data)
    return {
        "laws": laws_of(data),
        "exponents": [asdict(row) | {"theory": predicted(row)} for row in analysis.exponents],
        "bounded": [asdict(row) for row in analysis.bounded],
        "errors": rows_of(data.errors),
        "references": rows_of(data.references),
        "statements": findings(data, analysis),
    }


def needed_rows(runs: Frame, order: str, column: str = "slow") -> list[dict[str, str]]:
    """For each kind the St from which each error is met, in half of the bodies and in 97.5 %.

    The columns "t0", "t1" and so on belong to `ERRORS_MET`. Errors are of L and E ("slow"), or of the orientation
    ("turned").
    """
    rows = []
    for kind in kinds_in(runs):
        row = {"kind": kind}
        halves, mosts = (
            all_needed(runs, kind, order, share, ERRORS_MET, column) for share in SHARES
        )
        for i, (half, most) in enumerate(zip(halves, mosts, strict=True)):
            row[f"t{i}"] = _both(half, most)
        rows.append(row)
    return rows


def interval_rows(runs: Frame, order: str, column: str = "slow") -> list[dict[str, str]]:
    """For each kind the intervals of the St from which 97.5 % meet each error; columns as in `needed_rows`."""
    rows = []
    for kind in kinds_in(runs):
        row = {"kind": kind}
        answers = all_needed(runs, kind, order, SHARES[-1], ERRORS_MET, column)
        for i, answer in enumerate(answers):
            row[f"t{i}"] = "–" if isnan(answer.stokes) else _interval(answer.low, answer.high)
        rows.append(row)
    return rows


def largest_rows(runs: Frame, order: str) -> list[dict[str, str]]:
    """For each kind how many of the bodies at the largest St meet each error, with the interval of their share."""
    rows = []
    for kind in kinds_in(runs):
        there = runs[(runs["kind"] == kind) & (runs["order"] == order)]
        last = there[there["stokes"] == there["stokes"].max()]
        row = {"kind": kind}
        for i, target in enumerate(ERRORS_MET):
            met = int((last["slow"] <= target).sum())
            low, high = wilson(met, len(last))
            row[f"t{i}"] = f"{met} of {len(last)} ({100 * low:.0f} to {100 * high:.0f} %)"
        rows.append(row)
    return rows


def _interval(low: float, high: float) -> str:
    """The ends of an interval of St in words; the upper one may be unknown."""
    if isnan(high):
        return f"{in_two_digits(low)} or more"
    return f"{in_two_digits(low)} to {in_two_digits(high)}"


def cost_rows(data: Data, runs: Frame, order: str) -> list[dict[str, str]]:
    """For each kind how many times as fast as the full equations an order is (`gains`); columns as in `needed_rows`."""
    rows = []
    for kind in kinds_in(runs):
        row = {"kind": kind}
        for i, (ratio, source) in enumerate(gains(data, runs, kind, order)):
            row[f"t{i}"] = _gain(ratio, source)
        rows.append(row)
    return rows


def gains(data: Data, runs: Frame, kind: str, order: str) -> list[tuple[float, str]]:
    """How many times as long the full equations take where 97.5 % of the bodies meet an error, and the source.

    There is one pair for each of ERRORS_MET. Both times are taken at a decade of St at which full runs were
    timed: the first one at or above the St from which on the error is met. Above the last such decade, full
    runs are taken to need a time in proportion to St. The ratio is NaN if a time or that St is unknown; the
    source is one of `Needed.source`.
    """
    form = form_seconds(runs, kind, order)
    answers = all_needed(runs, kind, order, SHARES[-1], ERRORS_MET)
    return [
        _gain_at(full_seconds(data, kind, target), form, answer.stokes, answer.source)
        for target, answer in zip(ERRORS_MET, answers, strict=True)
    ]


def _gain_at(
    full: dict[float, float], form: dict[float, float], stokes: float, source: str
) -> tuple[float, str]:
    """The ratio at one St, of seconds by St, and its source."""
    if isnan(stokes) or not full or not form:
        return nan, source
    largest = max(full)
    timed_at = min((decade for decade in full if decade >= stokes), default=largest)
    seconds = form[shares.nearest(form, max(stokes, timed_at))]
    beyond = stokes / largest
    if beyond > 1:
        # Steps of a full run grow like St.
        return full[timed_at] * beyond / seconds, "extrapolated"
    return full[timed_at] / seconds, source


def _slower(data: Data, runs: Frame) -> dict[str, list[tuple[str, float, float]]]:
    """By order the kinds and errors for which it is slower than the full equations where 97.5 % meet the error.

    The third number is the ratio of `gains`, below 1. Extrapolated ratios are left out.
    """
    slower: dict[str, list[tuple[str, float, float]]] = {}
    for order in (ORDER_ONE, ORDER_TWO):
        slower[order] = []
        for kind in kinds_in(runs):
            ratios = gains(data, runs, kind, order)
            for target, (ratio, source) in zip(ERRORS_MET, ratios, strict=True):
                if ratio < 1 and source != "extrapolated":
                    slower[order].append((kind, target, ratio))
    return slower


def hybrid_rows(data: Data, runs: Frame) -> list[dict[str, str]]:
    """For each kind how often `hybrid` meets an error, and how many times as fast as the full equations it is.

    Columns "met0" and so on belong to `REQUESTED_ERRORS`, "gain0" and so on to `_HYBRID_SHOWN`.
    """
    rows = []
    hybrid = runs[runs["order"] == HYBRID]
    for kind in kinds_in(hybrid):
        kind_runs = hybrid[hybrid["kind"] == kind]
        row = {"kind": kind, "bodies": str(kind_runs["body"].nunique())}
        for i, requested in enumerate(random_study.REQUESTED_ERRORS):
            error_runs = kind_runs[kind_runs["requested"] == requested]
            met = error_runs["slow"] <= np.maximum(requested, error_runs["uncertainty"])
            row[f"met{i}"] = f"{100 * met.mean():.3g} % of {len(met)}"
        full = full_seconds(data, kind, _HYBRID_ERROR)
        form = form_seconds(kind_runs, kind, HYBRID, _HYBRID_ERROR)
        for i, stokes in enumerate(_HYBRID_SHOWN):
            both = stokes in full and stokes in form
            row[f"gain{i}"] = in_two_digits(full[stokes] / form[stokes]) if both else "–"
        rows.append(row)
    return rows


def time_rows(data: Data) -> list[dict[str, str]]:
    """For each kind the St from which `_SHOWN_TARGET` is met; "first0", "second0" and so on by order and slow time."""
    rows = []
    frames = {slow_time: at(data, slow_time) for slow_time in STUDIED_SLOW_TIMES}
    for kind in kinds_in(frames[WHOLE]):
        row = {"kind": kind}
        for i, runs in enumerate(frames.values()):
            for order, name in ((ORDER_ONE, "first"), (ORDER_TWO, "second")):
                half, most = (needed(runs, kind, order, share, _SHOWN_TARGET) for share in SHARES)
                row[f"{name}{i}"] = _both(half, most)
        rows.append(row)
    return rows


def exponent_rows(fitted: Sequence[Exponent]) -> list[dict[str, str]]:
    """A row for each kind, order and error; a column for each decade."""
    rows: dict[tuple[str, str, str, bool], dict[str, str]] = {}
    for exponent in sorted(fitted, key=_place):
        # A range of theory whose ends are equal is written once.
        theory = dict.fromkeys(_signed(value, ".2g") for value in predicted(exponent))
        blank = {
            "kind": _crossing_kind(exponent),
            "order": exponent.order,
            "error": _ERRORS[exponent.error],
            "theory": " to ".join(theory),
            **{f"d{decade}": "–" for decade in range(len(_DECADES) - 1)},
        }
        key = exponent.kind, exponent.order, exponent.error, exponent.crosses
        row = rows.setdefault(key, blank)
        decade = _DECADES.index(exponent.begin)
        cell = f"{_signed(exponent.median, '.2f')} ± {exponent.width:.2f}"
        if exponent.bodies < _ALMOST_ALL * exponent.of:
            cell += f" ({exponent.bodies} of {exponent.of})"
        row[f"d{decade}"] = cell
    return [*rows.values()]


def why_wide(exponent: Exponent) -> str:
    """What makes the interval of an exponent wide, in words."""
    slower, faster = sorted(predicted(exponent), reverse=True)
    reasons = []
    if slower != faster:
        reasons.append(f"the law changes from {_signed(faster, 'g')} to {_signed(slower, 'g')}")
    if exponent.bodies < _FEW_BODIES:
        reasons.append(f"{exponent.bodies} bodies")
    span = f"{short(exponent.begin)} to {short(exponent.end)}"
    why = "; ".join(reasons) or "no reason is known"
    kind = _crossing_kind(exponent)
    return f"{kind}, {exponent.order}, {_ERRORS[exponent.error]}, {span}: {why}"


def _place(row: Exponent | Bounded) -> tuple[str, str, int]:
    """Key by which rows are sorted: order, error, kind."""
    return row.order, row.error, [*KINDS].index(row.kind)


def _crossing_kind(exponent: Exponent) -> str:
    """The kind, and whether only its crossing bodies are meant."""
    mixed = exponent.crosses and exponent.kind != "crosses"
    return f"{exponent.kind}, crossing" if mixed else exponent.kind


def _against_theory(fitted: Sequence[Exponent]) -> dict[tuple[str, str], list[Exponent]]:
    """The exponents of each kind between the largest two St that give one, by order and error."""
    last: dict[tuple[str, str, str, bool], Exponent] = {}
    for exponent in sorted(fitted, key=lambda exponent: exponent.end):
        last[exponent.kind, exponent.order, exponent.error, exponent.crosses] = exponent
    groups: dict[tuple[str, str], list[Exponent]] = {}
    for exponent in last.values():
        groups.setdefault((exponent.order, exponent.error), []).append(exponent)
    return groups


def _spans(runs: Frame, order: str) -> list[tuple[float, list[tuple[str, float, float]]]]:
    """For each error of `_SENTENCE_TARGETS` the kinds with the St from which half and 97.5 % meet it.

    The kinds that meet it at the smallest St come first.
    """
    spans = []
    for target in _SENTENCE_TARGETS:
        kinds = []
        for kind in kinds_in(runs):
            half, most = (needed(runs, kind, order, share, target) for share in SHARES)
            if not isnan(half.stokes):
                kinds.append((kind, half.stokes, most.stokes))
        spans.append((target, sorted(kinds, key=lambda row: row[1])))
    return spans


def _bounded_row(row: Bounded) -> dict[str, str]:
    """A row of the table of stated bounds."""
    low, high = row.interval
    return {
        "kind": row.kind,
        "order": row.order,
        "error": _ERRORS[row.error],
        "runs": str(row.runs),
        "share": f"{100 * row.share:.1f} %",
        "bodies": f"{row.held} of {row.bodies} ({100 * low:.0f} to {100 * high:.0f} %)",
        "worst": f"{row.worst:.2g}",
        "over": f"{row.over:.2g}",
    }


def reference_rows(data: Data) -> list[dict[str, str]]:
    """Method, uncertainties (median / largest) and median seconds of the references, by St.

    The columns of a reference are uncertainties, of L and E ("slow") and of the orientation ("turned").
    """
    rows = []
    for stokes, references in data.references.groupby("stokes"):
        known = references[references["failure"] == ""]
        slow = known[f"slow_{WHOLE:g}"]
        turned = known[f"turned_{WHOLE:g}"]
        rows.append(
            {
                "stokes": short(float(str(stokes))),
                "method": "; ".join(dict.fromkeys(known["method"])),
                "slow": f"{slow.median():.1e} / {slow.max():.1e}",
                "turned": f"{turned.median():.1e} / {turned.max():.1e}",
                "seconds": in_two_digits(float(known["seconds"].median())),
            }
        )
    return rows


def count_rows(data: Data) -> list[dict[str, Any]]:
    """Bodies by kind and St, those whose references failed too."""
    counts = data.references.groupby(["kind", "stokes"]).size().unstack(fill_value=0)
    return [
        {"kind": kind, "counts": counts.loc[kind].tolist()} for kind in kinds_in(data.references)
    ]


def _panels(data: Data) -> dict[str, list[Band]]:
    """Bands of L and E by kind, crossing and not, and of the orientation by second order.

    A kind whose bodies are all refused has none, and is left out of the orientation.
    """
    runs = at(data, WHOLE)
    averaged = runs[runs["order"].isin(THEORY)]
    panels: dict[str, list[Band]] = {kind: [] for kind in kinds_in(averaged)}
    refused = _refusals(data)
    averaged = averaged[~averaged["kind"].isin(refused)]
    for (kind, order, crosses), group in averaged.groupby(["kind", "order", "crosses"]):
        panels[str(kind)] += _band(group, "slow", str(order), bool(crosses))
    turned = averaged[(averaged["order"] == ORDER_TWO) & ~averaged["crosses"]]
    # The kicks of strong resonances spoil the orientation (`shares.exponents`).
    turned = turned[turned["kind"] != "resonance"]
    panels[_ORIENTATION] = _band(turned, "turned", ORDER_TWO, False)
    return panels


def _refusals(data: Data) -> dict[str, str]:
    """Why averaging refuses all bodies of a kind, in words for its panel, by kind."""
    runs = at(data, WHOLE)
    averaged = runs[runs["order"].isin(THEORY)]
    refusals = {}
    for kind in kinds_in(averaged):
        kind_runs = averaged[averaged["kind"] == kind]
        if kind_runs["slow"].isna().all():
            (reason, *_) = kind_runs["refused"].mode()
            refusals[kind] = f"all refused: {reason}"
    return refusals


def _band(group: Frame, column: str, order: str, crosses: bool) -> list[Band]:
    """The band of an error, a column of `group`, over St: a list of one, or of none if a quantile is unknown."""
    ends = []
    for share in _BAND:
        end = quantile(group, share, column)
        if end is None:
            return []
        ends.append(end)
    # `quantile` leaves out St with few bodies: these are the same for all shares.
    stokes = ends[0].stokes
    return [Band(order, crosses, stokes, *(tuple(end.error) for end in ends))]


def _both(of_half: Needed, of_most: Needed) -> str:
    """St from which half of a kind and 97.5 % of it meet an error, in words.

    The sign of a missing St is written once if it is the same for both.
    """
    half = _needed(of_half)
    most = _needed(of_most)
    neither = half == most and half.startswith(("–", ">"))
    return half if neither else f"{half} / {most}"


def _needed(answer: Needed) -> str:
    """St from which an error is met, with the sign of its source (`Needed.source`).

    "<": at most the smallest St measured; "~": extrapolated; ">": the extrapolated St exceeds
    LARGEST_STOKES, or the error is missed at the largest St and nothing may be extrapolated; "–": never, as
    too many bodies are refused, or too few were measured.
    """
    if answer.source == "beyond":
        return f"> {short(shares.LARGEST_STOKES)}"
    if isnan(answer.stokes):
        return "–"
    sign = {"at most": "< ", "extrapolated": "~ "}.get(answer.source, "")
    return f"{sign}{in_two_digits(answer.stokes)}"


def _gain(ratio: float, source: str) -> str:
    """A ratio of times, with ~ if it is extrapolated."""
    if isnan(ratio):
        return "–"
    shown = in_two_digits(ratio)
    return f"~ {shown}" if source == "extrapolated" else shown


def _signed(value: float, spec: str) -> str:
    """A number in a format of Python, with the minus sign of typography."""
    return format(value, spec).replace("-", "−")
