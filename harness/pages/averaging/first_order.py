"""Both orders of averaging in the paper's cases: for the terminal, as JSON, and as a page with figure and data."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict
from math import isnan, nan
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import rows_of
from polhode.harness.averaging import measure, orders
from polhode.harness.averaging.data import VARIABLES, AveragingErrors, PaperStudy, write_study
from polhode.harness.averaging.orders import LEAST_POINTS, NEEDED_ERRORS, first_order, laws
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.text import aligned, cells, in_two_digits, short
from polhode.harness.pages.figures.averaging import Line, against_stokes
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import columns_of, fill, lines_of

# St from which on, by the paper, the averaged equations are good.
_GOOD_FROM = {"spheroid": 1e2, "ellipsoid": 1e3}
# Errors of which the page says from which St on they are met.
_SHOWN = (1e-2, 1e-4)
_PANELS = {"spheroid": "spheroids", "ellipsoid": "triaxial ellipsoids"}
_FIELDS = [text.strip("{}") for text in columns_of("accuracy").values()]


def statements(rows: Sequence[AveragingErrors]) -> list[str]:
    """How good the paper's "good from St ≈ 100" is, and which orders hold."""
    fitted_laws = laws(rows)
    good = []
    first = [law for law in fitted_laws if first_order(law.form)]
    for family, stokes in _GOOD_FROM.items():
        there = [
            row
            for row in rows
            if row.family == family and row.stokes == stokes and first_order(row.form)
        ]
        needed = [law.needed(1e-2)[0] for law in first if law.family == family]
        stokes_needed = sorted(number for number in needed if not isnan(number))
        good.append((family, stokes, sorted(there, key=lambda row: row.model_error), stokes_needed))
    predicted = [("First order", 1, first)]
    for family, title in (
        ("spheroid", "spheroids"),
        ("ellipsoid", "ellipsoids, no farther than L² = 2EI₂"),
    ):
        second = [law for law in fitted_laws if law.family == family and law not in first]
        predicted.append((f"Second order, {title}", 2, second))
    fitted = []
    for title, order, title_laws in predicted:
        with_order = [law for law in title_laws if not isnan(law.order)]
        fitted.append((title, order, title_laws, with_order))
    single = []
    for name in VARIABLES:
        single += [(name, law) for law in laws(rows, name) if first_order(law.form)]
    return lines_of(
        "accuracy-findings", good=good, predicted=fitted, single=single, points=LEAST_POINTS
    )


def as_text(study: PaperStudy) -> str:
    """The findings, and the table of the page, for a terminal."""
    columns = columns_of("accuracy")
    return "\n".join(
        [
            *statements(study.errors),
            "",
            aligned([*columns], cells(case_rows(study.errors), columns)),
        ]
    )


def as_json(study: PaperStudy) -> dict[str, Any]:
    """Errors, laws, absences and statements as plain data."""
    rows = study.errors
    return {
        "variables": list(VARIABLES),
        "errors": [
            asdict(row) | {"model_error": row.model_error, "solver_error": row.solver_error}
            for row in rows
        ],
        "laws": rows_of(pd.DataFrame(law_rows(rows))),
        "absent": [asdict(row) for row in study.absent],
        "statements": statements(rows),
    }


def write_page(study: PaperStudy, folder: Path, command: str) -> None:
    """Write the page, its figure and its data into a folder."""
    write_study(study, folder)
    write_file(
        folder / "laws.csv", pd.DataFrame(law_rows(study.errors)).to_csv(index=False), summed=True
    )
    lines: dict[str, list[Line]] = {title: [] for title in _PANELS.values()}
    for law in laws(study.errors):
        order = 1 if first_order(law.form) else 2
        lines[_PANELS[law.family]].append(Line(order, order, law.stokes, law.error))
    save(against_stokes(lines, "error of L and E over $I_{max}$"), folder, "errors")
    write_file(folder / "README.md", page(study, command))


def law_rows(rows: Sequence[AveragingErrors]) -> list[dict[str, Any]]:
    """One row per case and form: the orders per variable and of the slow error, and the St that errors need."""
    order_of = {}
    for name in VARIABLES:
        for law in laws(rows, name):
            order_of[law.subject, law.form, name] = law.order
    law_table = []
    for law in laws(rows):
        row = {"case": law.subject, "form": law.form, "to_t2": law.horizon}
        row |= {
            "St_from": law.alike[0][0],
            "St_to": law.alike[0][-1],
            "St_fitted": len(law.fitted[0]),
        }
        row |= {
            f"order_{name}": order_of.get((law.subject, law.form, name), nan) for name in VARIABLES
        }
        row |= {
            "order": law.order,
            **dict(zip(("order_low", "order_high"), law.order_interval, strict=True)),
        }
        for target in NEEDED_ERRORS:
            row[f"St_for_{target:g}"], row[f"from_{target:g}"] = law.needed(target)
        law_table.append(row)
    return law_table


def case_rows(rows: Sequence[AveragingErrors]) -> list[dict[str, str]]:
    """One row per case: the St that errors need, and the orders, of first and of second order."""
    rows_by_case: dict[str, dict[str, str]] = defaultdict(lambda: dict.fromkeys(_FIELDS, "–"))
    for law in laws(rows):
        row = rows_by_case[law.subject]
        which = "first" if first_order(law.form) else "second"
        low, high = law.order_interval
        row |= {
            "case": law.subject,
            which: "–" if isnan(low) else f"{law.order:.2f} ({low:.2f} to {high:.2f})",
        }
        row |= {f"{which}_{target:.0e}": _needed(*law.needed(target)) for target in _SHOWN}
        if which == "second":
            row["until"] = f"{law.horizon:.3g}"
    return list(rows_by_case.values())


def page(study: PaperStudy, command: str) -> str:
    """The report as Markdown."""
    head = header("How accurate the averaged equations are", command, list(study.timed.values()))
    about = {"header": head, "findings": statements(study.errors), "cases": case_rows(study.errors)}
    return fill("accuracy", **about, study=study, fitted=orders, measured=measure)


def _needed(stokes: float, source: str) -> str:
    if isnan(stokes):
        return "–"
    if source == "at most":
        return f"< {short(float(f'{stokes:.3g}'))}"
    return ("~ " if source == "extrapolated" else "") + in_two_digits(stokes)
