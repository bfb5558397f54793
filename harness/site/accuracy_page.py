"""How far the averaged equations are from the full ones."""

from html import escape

from polhode.harness.accuracy import FITTED_FROM, TARGETS, first_order, laws, statements
from polhode.harness.accuracy_page import COLORS, LAWS_HEADER, law_rows
from polhode.harness.site.markup import Page, bullets, chart, missing, table
from polhode.harness.site.sources import Sources
from polhode.harness.text import scientific

LEAD = "Model error: the averaged equations' exact solution against the full equations', along the whole run."
HEADER = ["case", "form", "St", "to t₂", "model error", "solver error", "reference"]


def accuracy_page(sources: Sources) -> Page:
    """Orders, the St that an error needs, and the model error as a diagram."""
    rows = sources.accuracy
    if not rows:
        body = missing("The accuracy of the averaged forms is", "polhode accuracy")
        return Page("accuracy", "How good is averaging?", LEAD, body)
    subjects = list(dict.fromkeys(row.subject for row in rows))
    series = [
        {
            "name": law.subject + ("" if first_order(law.form) else ", second order"),
            "color": COLORS[subjects.index(law.subject) % len(COLORS)],
            "mark": "o" if first_order(law.form) else "s",
            "dash": "" if first_order(law.form) else "5 3",
            "line": True,
            "points": [
                [stokes, error, f"{law.subject}\n{law.form}\nSt = {stokes:.3g}\nmodel error {scientific(error)}"]
                for stokes, error in zip(law.stokes, law.error, strict=True)
            ],
        }
        for law in laws(rows)
    ]
    spec = {
        "label": "Model error against St",
        "x": {"label": "Stokes number St", "log": True},
        "y": {"label": "slow error over I_max", "log": True},
        "series": series,
        "legend": True,
        "rules": [{"y": target} for target in TARGETS],
    }
    errors = [
        [
            row.subject,
            row.form,
            f"{row.stokes:.3g}",
            f"{row.until:.3g}",
            *map(scientific, (row.model_error, row.solver_error, row.uncertainty)),
        ]
        for row in rows
    ]
    body = (
        bullets(statements(rows))
        + chart("accuracy-chart", "Largest error of L and E along the run over I_max. Dashed: second order.")
        + "<h2>Order in 1/St, and the St that an error needs</h2>"
        f"<p>Fitted from St = {FITTED_FROM:g} on, with the 95 % interval. "
        "“&lt;”: already at the smallest St measured; “~”: beyond the largest one, by the fitted law.</p>"
        + table(LAWS_HEADER, law_rows(rows), range(2, len(LAWS_HEADER)))
        + f"<details><summary>{escape('Every error')}</summary>{table(HEADER, errors, range(2, 7))}</details>"
    )
    scripts = ("tables.js", "chart.js")
    return Page(
        "accuracy", "How good is averaging?", LEAD, body, ("polhode accuracy",), {"accuracy-chart": spec}, scripts
    )
