"""How far the averaged equations are from the full ones."""

from collections.abc import Sequence
from html import escape
from typing import Any

from polhode.harness.averaging.data import AveragingErrors
from polhode.harness.averaging.findings import statements
from polhode.harness.averaging.orders import TARGETS, Law, first_order, laws
from polhode.harness.common.text import scientific
from polhode.harness.pages.averaging import (
    ABSENT_HEADER,
    COLORS,
    LAWS_HEADER,
    absent_rows,
    definitions,
    fits,
    law_rows,
)
from polhode.harness.site.markup import Page, bullets, chart, missing, prose, table
from polhode.harness.site.origins import told
from polhode.harness.site.sources import Sources

LEAD = "Model error: the averaged equations' exact solution against the full equations', along the whole run."
HEADER = ["case", "form", "St", "to t₂", "model error", "solver error", "reference"]
FAMILIES = {"spheroid": "Spheroids", "ellipsoid": "Triaxial ellipsoids"}
CAPTION = (
    "{family}: largest error of L and E along the run, over I_max. Circles: first order; squares, dashed: second order"
    "{limit}. Dotted: errors that the table below asks for."
)


def accuracy_page(sources: Sources) -> Page:
    """Orders, the St that an error needs, and the model error as a diagram."""
    rows = sources.accuracy
    if not rows:
        body = missing("The accuracy of the averaged forms is", "polhode accuracy")
        return Page("accuracy", "How good is averaging?", LEAD, body)
    found = laws(rows)
    own = {family: [law for law in found if law.family == family] for family in FAMILIES}
    data = {f"{family}-chart": _diagram(family, drawn) for family, drawn in own.items() if drawn}
    charts = [chart(f"{family}-chart", _caption(family)) for family, drawn in own.items() if drawn]
    body = (
        bullets(statements(rows))
        + "".join(charts)
        + "<h2>Order in 1/St, and the St that an error needs</h2>"
        + table(LAWS_HEADER, law_rows(rows), range(2, len(LAWS_HEADER)))
        + "".join(f"<p class=note>{prose(text)}</p>" for text in fits() if text)
        + _absences(sources)
        + f"<details><summary>Every error</summary>{table(HEADER, map(_errors, rows), range(2, 7))}"
        f"{bullets(text.removeprefix('- ') for text in definitions(rows))}</details>"
    )
    origin = told(sources.folder / "accuracy")
    scripts = ("tables.js", "chart.js")
    return Page("accuracy", "How good is averaging?", LEAD, body, ("polhode accuracy",), (origin,), data, scripts)


def _errors(row: AveragingErrors) -> list[str]:
    numbers = map(scientific, (row.model_error, row.solver_error, row.uncertainty))
    return [row.subject, row.form, f"{row.stokes:.3g}", f"{row.until:.3g}", *numbers]


def _absences(sources: Sources) -> str:
    if not sources.absent:
        return ""
    summary = f"Where there is no error ({len(sources.absent)}), and why"
    reasons = table(ABSENT_HEADER, absent_rows(sources.absent))
    return f'<details class="reasons"><summary>{escape(summary)}</summary>{reasons}</details>'


def _caption(family: str) -> str:
    limit = ", no farther than L² = 2EI₂" if family == "ellipsoid" else ""
    return CAPTION.format(family=FAMILIES[family], limit=limit)


def _diagram(family: str, own: Sequence[Law]) -> dict[str, Any]:
    """Model errors against St: a colour for each case, both orders under its name."""
    subjects = list(dict.fromkeys(law.subject for law in own))
    ordered = sorted(own, key=lambda law: (not first_order(law.form), subjects.index(law.subject)))
    return {
        "label": f"Model error against St, {FAMILIES[family].lower()}",
        "x": {"label": "Stokes number St", "log": True},
        "y": {"label": "slow error over I_max", "log": True},
        "series": [_series(law, COLORS[subjects.index(law.subject) % len(COLORS)]) for law in ordered],
        "legend": True,
        "rules": [{"y": target} for target in TARGETS],
    }


def _series(law: Law, color: str) -> dict[str, Any]:
    first = first_order(law.form)
    points = zip(law.stokes, law.error, law.until, strict=True)
    return {
        "name": law.subject,
        "color": color,
        "mark": "o" if first else "s",
        "dash": "" if first else "5 3",
        "line": True,
        "points": [[stokes, error, _tip(law, stokes, error, until)] for stokes, error, until in points],
    }


def _tip(law: Law, stokes: float, error: float, until: float) -> str:
    return f"{law.subject}\n{law.form}\nSt = {stokes:.3g}, to t₂ = {until:.3g}\nmodel error {scientific(error)}"
