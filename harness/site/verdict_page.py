"""The opening page: the verdict in sentences, and the regime map."""

from collections.abc import Iterable
from html import escape
from math import isnan
from statistics import median_high

import pandas as pd

from polhode.harness.analysis.frames import where
from polhode.harness.analysis.regime_map import Cell, cells
from polhode.harness.analysis.winners import TARGETS, TIE, averaged_costs, averaged_forms, by_scene, when_averaged_wins
from polhode.harness.common.text import duration, short
from polhode.harness.pages.regime_text import horizon
from polhode.harness.pages.regimes import COLORS, HEADINGS, usual_form
from polhode.harness.site.markup import Page, bullets, missing, prose, scroll, table
from polhode.harness.site.origins import commands, origins
from polhode.harness.site.sources import Sources, StudyRecords
from polhode.harness.studies.study import read_study

TITLE = "What should I run?"
LEAD = (
    "For a massive ellipsoid in simple shear flow: which form of the equations, which solver, at what cost, as the "
    "Stokes number St grows and the error allowed shrinks."
)
REGIMES = "polhode regimes"
ERRORS = {
    "orientation_error": ("full solution", "error of the orientation in rad, largest along the run"),
    "slow_error": ("slow variables", "error of L and E over I_max, largest along the run"),
}
# A scene with fewer St than this makes no map.
LEAST_STOKES = 2
OTHER = "#999999"
# Letters of a name that may be broken at its hyphens.
LONG = 12


def verdict_page(sources: Sources) -> Page:
    """What to run, in sentences and as a map over St and error."""
    body = []
    bench, regimes = sources.studies.get("bench"), sources.studies.get("regimes")
    if bench:
        body += _averaging(bench.table)
    else:
        body.append(missing("The main job is", "polhode bench"))
    if not regimes:
        body.append(missing("The regime map from St = 1e-4 to 1e8 is", REGIMES))
    study = regimes or bench
    body += _maps(study) if study else []
    body.append("<p>For a scene of your own: <code>polhode pick ice.toml --error 1e-6 --want slow</code>.</p>")
    shown = [study for study in (bench, regimes) if study]
    made_by = commands(sources.folder, shown)
    return Page("index", TITLE, LEAD, "".join(body), made_by, origins(sources.folder, shown))


def _averaging(records: pd.DataFrame) -> list[str]:
    """From which St on averaging pays, and what it costs."""
    scenes = [(name or str(records["scene_name"].to_list()[0]), runs) for name, runs in by_scene(records)]
    header = ["slow error", *(f"{name}, {_shape(runs)}, St = {_span(runs['stokes'])}" for name, runs in scenes)]
    rows = [[tens(target), *(_pays(runs, target) for _, runs in scenes)] for target in TARGETS]
    text = (
        "The averaged equations solve for the slow variables L and E alone. Where they, to first or second order, are "
        "the cheapest way to an error of L and E, over I_max and largest along the run:"
    )
    return [
        "<h2>When averaging pays</h2>",
        f"<p>{prose(text)}</p>",
        table(header, rows),
        f"<details><summary>What averaging costs</summary>{bullets(averaged_costs(records))}</details>",
    ]


def _shape(runs: pd.DataFrame) -> str:
    return f"semi-axes ({', '.join(map(short, runs['scene.shape.semi_axes'].to_list()[0]))})"


def _pays(runs: pd.DataFrame, target: float) -> str:
    if not averaged_forms(runs):
        return "not tried"
    found = when_averaged_wins(runs, target, tens)
    return f"not up to St = {tens(max(runs['stokes'].to_list()))}" if found is None else found


def _span(values: Iterable[float]) -> str:
    numbers = sorted(set(map(float, values)))
    return tens(numbers[0]) if len(numbers) == 1 else f"{tens(numbers[0])} to {tens(numbers[-1])}"


def _maps(study: StudyRecords) -> list[str]:
    parts = []
    for scene in dict.fromkeys(study.table["scene_name"]):
        runs = where(study.table, study.table["scene_name"] == scene)
        if len(set(runs["stokes"])) < LEAST_STOKES:
            continue
        for error, (what, unit) in ERRORS.items():
            if len(runs[error].dropna()):
                found = cells(runs, error)
                title = f"<h3>{escape(str(scene))}: {what}</h3>{_horizon(str(scene))}{_sides(found)}{_key(found)}"
                parts.append(f'<section class="region">{title}{_map(found, unit)}</section>')
    if not parts:
        return []
    text = (
        "The cheapest method at each St and error, the time of a warm run, interpolated between tolerances, and by "
        "what factor it leads: ×2 says that the next method takes twice as long, = names a method that ties with it, "
        f"within {100 * (TIE - 1):.0f} %. Averaged forms stand under their own name, whichever solver runs them. "
        "“none”: no run measured gets there. “unknown”: no reference is good enough to tell."
    )
    return ["<h2>Regime map</h2>", f"<p>{text}</p>", *parts]


def _horizon(name: str) -> str:
    """How far runs of a scene of the map go, where that is less slow time than elsewhere."""
    remarks = horizon([scene for own, scene in read_study(None, "regimes").scenes if own == name])
    return "".join(f"<p>{prose(remark)}</p>" for remark in remarks if remark)


def _sides(found: list[Cell]) -> str:
    """Which kind of method wins where, and by how much."""
    rows = []
    for side, (_, kind) in HEADINGS.items():
        own = [cell for cell in found if cell.winner and cell.winner.side == side]
        leads = [cell.lead for cell in own if not isnan(cell.lead)]
        lead = f"{_factor(median_high(leads))}, {_factor(max(leads))}" if leads else "–"
        ties = sum(cell.tied for cell in own)
        rows.append([kind, str(len(own)), str(ties), _span(cell.stokes for cell in own) if own else "–", lead])
    count = sum(cell.winner is not None for cell in found)
    return table(["kind", f"cells won of {count}", "of these ties", "at St", "lead: median, largest"], rows, (1, 2))


def _factor(value: float) -> str:
    return f"×{value:.{1 if value < 9.95 else 0}f}"


def _key(found: list[Cell]) -> str:
    """Colours by kind, and the form that full equations are run in."""
    winners = {cell.winner.label: cell.winner for cell in found if cell.winner}
    lines = []
    for side, (_, kind) in HEADINGS.items():
        own = [name for name in [*COLORS, *(set(winners) - set(COLORS))] if name in winners]
        marks = "".join(
            f'<span style="--c:{COLORS.get(name, OTHER)}">{escape(name)}</span>'
            for name in own
            if winners[name].side == side
        )
        lines += [f'<p class="key"><b>{kind}</b>{marks}</p>'] if marks else []
    usual = usual_form(found)
    form = f"Full equations in the form {usual}, unless a cell names another." if usual else ""
    return "".join(lines) + (f"<p class=note>{escape(form)}</p>" if form else "")


def _map(found: list[Cell], unit: str) -> str:
    numbers = sorted({cell.stokes for cell in found})
    targets = sorted({cell.target for cell in found}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in found}
    usual = usual_form(found)
    head = "".join(f"<th scope=col>{prose(tens(stokes))}</th>" for stokes in numbers)
    rows = "".join(
        f"<tr><th scope=row>{prose(tens(target))}</th>"
        f"{''.join(_cell(at[stokes, target], usual) for stokes in numbers)}</tr>"
        for target in targets
    )
    corner = "<th class=axis>error ↓ St →</th>"
    title = f"<caption>{prose(unit)}</caption>"
    return scroll(f"<table class=map>{title}<thead><tr>{corner}{head}</tr></thead><tbody>{rows}</tbody></table>")


def _cell(cell: Cell, usual: str) -> str:
    if cell.winner is None:
        words = "none" if cell.known else "unknown"
        tip = "no run measured gets there" if cell.known else "below what the reference can tell"
        return f'<td class="none" title="{tip}">{words}</td>'
    label = cell.winner.label
    name = f"<b{' class=long' if len(label) > LONG else ''}>{escape(label)}</b>"
    form = "" if cell.winner.side == "averaged" or cell.winner.form == usual else f"<i>{escape(cell.winner.form)}</i>"
    tip = f"{cell.winner}: {duration(cell.seconds)}; next: {cell.second or 'none'}"
    return (
        f'<td style="--c:{COLORS.get(label, OTHER)}" title="{escape(tip)}">'
        f"{name}{form}<span>{duration(cell.seconds)}{escape(_lead(cell))}</span></td>"
    )


def _lead(cell: Cell) -> str:
    if cell.second is None or isnan(cell.lead):
        return ""
    return f" ={cell.second.label}" if cell.tied else f" {_factor(cell.lead)}"


def tens(value: float) -> str:
    """A number in one digit, as plain text: 0.01, 10^4, 3·10^4."""
    mantissa, exponent = f"{value:.0e}".split("e")
    if value == 0 or -2 <= int(exponent) <= 2:
        return f"{value:g}"
    return ("" if mantissa == "1" else f"{mantissa}·") + f"10^{int(exponent)}".replace("-", "−")
