"""The opening page: the verdict in sentences, and the regime map."""

from html import escape
from math import isnan

from polhode.harness.regime_page import COLORS
from polhode.harness.regimes import Cell, cells
from polhode.harness.regimes import sentences as map_sentences
from polhode.harness.site.markup import Page, bullets, missing, scroll
from polhode.harness.site.sources import Sources, StudyRecords, measured
from polhode.harness.tables import where
from polhode.harness.text import duration
from polhode.harness.verdict import TIE, sentences

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
    body, made_by = [], []
    if "bench" in sources.studies:
        body.append(bullets(sentences(sources.studies["bench"].table)))
        made_by.append("polhode bench")
    else:
        body.append(missing("The main job is", "polhode bench"))
    regimes = sources.studies.get("regimes")
    if regimes:
        made_by.append(REGIMES)
    else:
        body.append(missing("The regime map from St = 1e-4 to 1e8 is", REGIMES))
    study = regimes or sources.studies.get("bench")
    body += _maps(study) if study else []
    body.append("<p>For a scene of your own: <code>polhode pick ice.toml --error 1e-6 --want slow</code>.</p>")
    if when := measured(study for study in (sources.studies.get("bench"), regimes) if study):
        body.append(f"<p class=note>Measured {when}.</p>")
    return Page("index", TITLE, LEAD, "".join(body), tuple(made_by))


def _maps(study: StudyRecords) -> list[str]:
    parts = []
    for scene in dict.fromkeys(study.table["scene_name"]):
        runs = where(study.table, study.table["scene_name"] == scene)
        if len(set(runs["stokes"])) < LEAST_STOKES:
            continue
        for error, (what, unit) in ERRORS.items():
            if len(runs[error].dropna()):
                found = cells(runs, error)
                title = f"<h3>{escape(str(scene))}: {what}</h3>{bullets(map_sentences(found, what))}"
                parts.append(f'<section class="region">{title}{_map(found, unit)}</section>')
    if not parts:
        return []
    text = (
        "The cheapest method at each St and error: its time, interpolated between tolerances, and by what factor it "
        f"leads over the next one; = where the two tie, within {100 * (TIE - 1):.0f} %."
    )
    return ["<h2>Regime map</h2>", f"<p>{text}</p>", *parts]


def _map(found: list[Cell], unit: str) -> str:
    numbers = sorted({cell.stokes for cell in found})
    targets = sorted({cell.target for cell in found}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in found}
    head = "".join(f"<th scope=col>{power(stokes)}</th>" for stokes in numbers)
    rows = "".join(
        f"<tr><th scope=row>{power(target)}</th>{''.join(_cell(at[stokes, target]) for stokes in numbers)}</tr>"
        for target in targets
    )
    corner = "<th class=axis>error ↓ St →</th>"
    title = f"<caption>{unit.replace('I_max', 'I<sub>max</sub>')}</caption>"
    return scroll(f"<table class=map>{title}<thead><tr>{corner}{head}</tr></thead><tbody>{rows}</tbody></table>")


def _cell(cell: Cell) -> str:
    if cell.winner is None:
        words = "nobody" if cell.known else "unknown"
        tip = "no method gets there" if cell.known else "below what the reference can tell"
        return f'<td class="none" title="{tip}">{words}</td>'
    lead = (
        ""
        if isnan(cell.lead)
        else f" ={_short(cell.second)}"
        if cell.tied
        else f" ×{cell.lead:.{1 if cell.lead < 9.95 else 0}f}"
    )
    label = cell.winner.label
    name = f"<b{' class=long' if len(label) > LONG else ''}>{escape(label)}</b>"
    tip = f"{cell.winner}: {duration(cell.seconds)}; next: {cell.second or 'nobody'}"
    return (
        f'<td style="--c:{COLORS.get(label, OTHER)}" title="{escape(tip)}">'
        f"{name}<span>{duration(cell.seconds)}{escape(lead)}</span></td>"
    )


def _short(method: object) -> str:
    return getattr(method, "label", "")


def power(value: float) -> str:
    """A number as HTML: powers of ten with a superscript."""
    mantissa, exponent = f"{value:.0e}".split("e")
    if value == 0 or -2 <= int(exponent) <= 2:
        return f"{value:g}"
    return ("" if mantissa == "1" else f"{mantissa}·") + f"10<sup>{int(exponent)}</sup>".replace("-", "−")
