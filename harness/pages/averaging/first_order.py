"""The accuracy of the averaged forms as a table for the terminal, as JSON, and as a page with figure and data."""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import cycle
from math import isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from polhode.harness.averaging.cases import paper_cases
from polhode.harness.averaging.data import VARIABLES, Absent, AveragingErrors, write_data
from polhode.harness.averaging.findings import statements
from polhode.harness.averaging.measure import SAMPLES, SOLVER, TOLERANCE, UNCERTIFIED, Found
from polhode.harness.averaging.orders import FITTED_FROM, LEAST_POINTS, SAME_HORIZON, TARGETS, Law, first_order, laws
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import versions
from polhode.harness.common.text import aligned, in_two_digits, markdown, scientific, short
from polhode.harness.pages.figures.work_precision import save
from polhode.models.shape import Ellipsoid

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ERRORS_HEADER = ["case", "form", "St", "to t₂", *(f"model {name}" for name in VARIABLES)]
ERRORS_HEADER += ["model", "solver", "reference"]
LAWS_HEADER = ["case", "form", "to t₂", "St measured", "St fitted"]
LAWS_HEADER += [*(f"order {name}" for name in VARIABLES), "order", "95 % interval"]
LAWS_HEADER += [f"St for {target:g}" for target in TARGETS]
ABSENT_HEADER = ["case", "form", "St", "reason"]
CASES_HEADER = ["case", "semi-axes", "θ, φ, ψ", "ω", "L"]

# Okabe and Ito's palette, safe for colour-blind readers.
COLORS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A7A7A")


def as_text(found: Found) -> str:
    """All tables and the statements, for a terminal."""
    rows, absent = found
    tables = [(ERRORS_HEADER, list(map(_error_row, rows))), (LAWS_HEADER, law_rows(rows))]
    tables += [(ABSENT_HEADER, absent_rows(absent))] if absent else []
    return "\n\n".join([*(aligned(*table) for table in tables), "\n".join(statements(rows))])


def as_json(found: Found) -> dict[str, Any]:
    """Errors, laws, absences and statements as plain data."""
    rows, absent = found
    return {
        "variables": list(VARIABLES),
        "errors": [asdict(row) | {"model_error": row.model_error, "solver_error": row.solver_error} for row in rows],
        "laws": [
            asdict(law)
            | {
                "fitted_stokes": law.fitted[0].tolist(),
                "order": _number(law.order),
                "order_interval": [_number(end) for end in law.order_interval],
                "stokes_for": {
                    f"{target:g}": {"stokes": _number(stokes), "from": source}
                    for target in TARGETS
                    for stokes, source in [law.needed(target)]
                },
            }
            for law in laws(rows)
        ],
        "absent": [asdict(row) for row in absent],
        "statements": statements(rows),
    }


def write_page(found: Found, folder: Path, command: str) -> None:
    """Write the page, its figure and its data into a folder."""
    write_data(*found, folder)
    save(figure(found[0]), folder, "errors")
    write_file(folder / "README.md", "\n".join(_lines(*found, command)))


def figure(rows: Sequence[AveragingErrors]) -> Any:
    """Model error against St, spheroids beside ellipsoids, over a line of slope -1."""
    import matplotlib.pyplot as plt

    drawing, panels = plt.subplots(1, 2, figsize=(11.0, 5.4), sharex=True, sharey=True)
    for axes, family in zip(panels, ("spheroid", "ellipsoid"), strict=True):
        _panel(axes, [law for law in laws(rows) if law.family == family])
        axes.set_title({"spheroid": "spheroids", "ellipsoid": "triaxial ellipsoids"}[family], fontsize=11)
        axes.set_xlabel("Stokes number St")
    panels[0].set_ylabel("largest error of L and E along the run, over $I_{max}$")
    drawing.tight_layout()
    return drawing


def _panel(axes: "Axes", own: Sequence[Law]) -> None:
    colors = dict(zip(dict.fromkeys(law.subject for law in own), cycle(COLORS), strict=False))
    for law in own:
        second = not first_order(law.form)
        axes.loglog(
            law.stokes,
            law.error,
            color=colors[law.subject],
            label=None if second else law.subject,
            linestyle="--" if second else "-",
            linewidth=1.3,
            marker="s" if second else "o",
            markersize=4,
        )
    if any(not first_order(law.form) for law in own):
        label = "the same, second order" + (" up to $L^2=2EI_2$" if own[0].family == "ellipsoid" else "")
        axes.plot([], [], color="0.3", linestyle="--", marker="s", markersize=4, label=label)
    x = [1e2, 1e6]
    axes.loglog(x, [3e1 / s for s in x], color="0.6", linewidth=0.9, linestyle=":", label="30/St")
    for target in TARGETS:
        axes.axhline(target, color="0.88", linewidth=0.8, zorder=0)
    axes.legend(fontsize=8, frameon=False, loc="lower left")


def law_rows(rows: Sequence[AveragingErrors]) -> list[list[str]]:
    """One row per case and form: the orders per variable and of the slow error, and the St that errors need."""
    each = {(law.subject, law.form, name): law.order for name in VARIABLES for law in laws(rows, name)}
    table = []
    for law in laws(rows):
        first, last = (_stokes(law.alike[0][end]) for end in (0, -1))
        low, high = law.order_interval
        orders = [*(each.get((law.subject, law.form, name), nan) for name in VARIABLES), law.order]
        table.append([law.subject, law.form, f"{law.horizon:.3g}", first if first == last else f"{first} to {last}"])
        table[-1] += [f"{len(law.fitted[0])}", *("–" if isnan(order) else f"{order:.2f}" for order in orders)]
        table[-1] += ["too few points" if isnan(low) else f"{low:.2f} to {high:.2f}"]
        table[-1] += [_needed(*law.needed(target)) for target in TARGETS]
    return table


def absent_rows(absent: Sequence[Absent]) -> list[list[str]]:
    """One row per case, form and reason, with the St that it concerns."""
    groups: dict[tuple[str, str, str], list[float]] = {}
    for row in absent:
        # What the certificate found differs from St to St; it stands in the data.
        reason = UNCERTIFIED if row.reason.startswith(UNCERTIFIED) else row.reason
        told = reason.replace(f"St = {row.stokes:g} is", "St is")
        groups.setdefault((row.subject, row.form, told), []).append(row.stokes)
    return [
        [subject, form, ", ".join(map(_stokes, numbers)), reason] for (subject, form, reason), numbers in groups.items()
    ]


def _lines(rows: Sequence[AveragingErrors], absent: Sequence[Absent], command: str) -> list[str]:
    return [
        "# How accurate the averaged equations are",
        "",
        f"Made by `{command}` with " + ", ".join(f"{name} {number}" for name, number in versions().items()) + ".",
        "Do not edit: the next run overwrites this page.",
        "",
        "## What a reader may conclude",
        "",
        *(f"- {sentence}" for sentence in statements(rows)),
        "",
        "On its way to L² = 2EI₂ a triaxial ellipsoid passes resonances of polhode and precession, and at each of them "
        "second order [leaves out](../../docs/second-order.md) a kick of O(St^-3/2). Its orders away from resonances "
        "stand in [its own study](../second-order/README.md).",
        "",
        "![Model error against St for spheroids and ellipsoids](errors.png)",
        "",
        f"- Errors are maxima over {SAMPLES} equispaced samples, from the start to the slow time t₂ = t/St in the "
        "column *to t₂*, divided by the largest moment of inertia. The *slow error* is the largest of the four.",
        "- First order is the paper's: `averaged` for triaxial ellipsoids, `averaged-spheroid` for spheroids. Second "
        "order, `averaged-second-order`, follows a triaxial ellipsoid to just short of L² = 2EI₂ alone: its errors are "
        "those of a shorter run, and not to be held against first order's over the whole one.",
        "- *Model*: the averaged equations' exact solution against the full equations', *model* without a variable "
        f"being the slow error. *Solver*: the averaged equations by `{SOLVER}` at tolerance {short(TOLERANCE)} against "
        "their exact solution, slow error.",
        f"- Every full solution is a certified reference: confirmed on at least {min(row.pieces for row in rows)} "
        "pieces by another form and method. *Reference* is its uncertainty, over the largest moment of inertia, at "
        f"most {scientific(max(row.uncertainty for row in rows))}.",
        "",
        "## Order in 1/St, and the St that an error needs",
        "",
        "The model error is taken as c/St^order and fitted by least squares on logarithms, from St = "
        f"{FITTED_FROM:g} on; *order* and its interval are the slow error's. *St fitted* counts the points; fewer "
        f"than {LEAST_POINTS} give no order. Orders hold for the horizon *to t₂*: runs that end before "
        f"{100 * SAME_HORIZON:g} % of it, as second order's do at small St, are left out of this table, because "
        "shorter runs err less.",
        "",
        "*St for* 0.1, 0.01, …: the St from which on the slow error (model) stays below that, interpolated between "
        "measured St. `<`: already at the smallest St of the row, below which the form refuses or nothing was "
        "measured. `~`: beyond the largest St, by the fitted law.",
        "",
        markdown(LAWS_HEADER, law_rows(rows), right=range(2, len(LAWS_HEADER))),
        "## Every error",
        "",
        "In full: [errors.csv](errors.csv).",
        "",
        markdown(ERRORS_HEADER, [_error_row(row) for row in rows], right=range(2, len(ERRORS_HEADER))),
        *_absences(absent),
        "## The cases",
        "",
        "Starts: Euler angles in rad, angular velocity in body axes over the shear rate, and the L in space axes that "
        "they give, over the largest moment of inertia.",
        "",
        markdown(CASES_HEADER, _case_rows(rows)),
    ]


def _absences(absent: Sequence[Absent]) -> list[str]:
    if not absent:
        return []
    table = [[cell.replace("|", "\\|") for cell in row] for row in absent_rows(absent)]
    return [
        "## Where there is no row",
        "",
        "In full, with what the certificate found: [absent.csv](absent.csv). *Too small for this run*: the form's own "
        "estimate of its slow error reaches the largest moment of inertia. *Too small for this start*: no start of the "
        "averaged equations leads to the scene's.",
        "",
        markdown(ABSENT_HEADER, table),
    ]


def _case_rows(rows: Sequence[AveragingErrors]) -> list[list[str]]:
    names = {row.subject for row in rows}
    table = []
    for case in paper_cases():
        if case.name in names:
            momentum = case.scene(1.0).initial.angular_momentum[0] / max(Ellipsoid(case.semi_axes).inertia)
            groups = case.semi_axes, case.start.angles, case.start.angular_velocity, momentum
            table.append([case.name, *(", ".join(_coordinate(x) for x in group) for group in groups)])
    return table


def _coordinate(value: float) -> str:
    """Three digits; 0 for what is rounding."""
    return f"{0.0 if abs(value) < 1e-9 else value:.3g}"


def _error_row(row: AveragingErrors) -> list[str]:
    numbers = (*row.model, row.model_error, row.solver_error, row.uncertainty)
    return [row.subject, row.form, _stokes(row.stokes), f"{row.until:.3g}", *(scientific(number) for number in numbers)]


def _needed(stokes: float, source: str) -> str:
    if isnan(stokes):
        return "–"
    if source == "at most":
        return f"< {_stokes(stokes)}"
    return ("~ " if source == "extrapolated" else "") + in_two_digits(stokes)


def _stokes(stokes: float) -> str:
    return short(float(f"{stokes:.3g}"))


def _number(value: float) -> float | None:
    return None if isnan(value) else value
