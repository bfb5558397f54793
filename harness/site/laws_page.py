"""The cost laws' predictions against what was measured."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from math import log10
from statistics import median

from polhode.harness.calibration.evaluation import FACTOR
from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, scientific, short
from polhode.harness.pages.work_precision import MARKERS
from polhode.harness.picking.laws import Interval, Laws, load_laws
from polhode.harness.picking.load import load_of
from polhode.harness.picking.pilot import Pilot, PilotFailedError, pilot
from polhode.harness.site.cost import colour_of
from polhode.harness.site.markup import Page, bullets, chart, missing, table
from polhode.harness.site.sources import Sources, StudyRecords
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.catalogue import solver as find_solver

TITLE = "Cost laws"
LEAD = "What `pick` believes a run will cost, against what runs cost that were not used to fit its laws."
HELD_OUT = "polhode validate"
PACED = "seconds_at_usual_pace"
# What is compared with "…_predicted", its measured column, and its name.
KINDS = {"seconds": (PACED, "time, s"), "slow_error": ("slow_error", "error of L and E, over I_max")}
PACE = (
    "Predicted times hold for the pace at which the machine ran when the laws were fitted. A sentinel, a fixed piece "
    "of arithmetic timed before every batch of runs, tells by how much it is slower or faster; measured times are "
    "divided by that here, so that both are at one pace. Runs on another machine or by another Python, where the "
    "sentinel is no measure, are compared as timed."
)
SCRIPTS = ("tables.js", "chart.js")
# More points than this make a cloud, not a diagram.
MOST_POINTS = 1500
DECADES = (1e-5, 1e2)


@dataclass(frozen=True)
class Compared:
    """A measured run, its time in seconds `at_usual_pace`, and the prediction for it."""

    scene: str
    stokes: float
    form: str
    solver: str
    tolerance: float
    seconds: float
    predicted: Interval

    @property
    def inside(self) -> bool:
        """Whether the measurement lies in the 95 % interval."""
        return self.predicted.low <= self.seconds <= self.predicted.high


def laws_page(sources: Sources, tell: Callable[[str], None]) -> Page:
    """Predicted against measured times and errors, on scenes held out and in the studies."""
    body, data, commands = [f"<p>{PACE}</p>"], {}, []
    rows = sources.predictions
    if rows:
        commands.append(HELD_OUT)
        body += ["<h2>On scenes held out</h2>", bullets(_judged(rows))]
        for kind, (column, label) in KINDS.items():
            data[f"held-out-{kind}"] = _held_out(rows, f"{kind}_predicted", column, label)
            what = "Time" if column == PACED else "Error of L and E"
            body.append(chart(f"held-out-{kind}", f"{what}, predicted and measured; on the line: as predicted."))
    else:
        body.append(missing("The evaluation on scenes held out is", HELD_OUT))
    try:
        laws = load_laws()
    except (OSError, ValueError, KeyError) as error:
        body.append(missing(f"The laws ({error!r}) are", "polhode calibrate"))
        return Page("laws", TITLE, LEAD, "".join(body), tuple(commands), (), data, SCRIPTS)
    found = [each for study in sources.studies.values() for each in compare(study, laws, tell)]
    if found:
        commands.append("polhode bench")
        data["laws-chart"] = _chart(found)
        body += ["<h2>In the studies</h2>", bullets(_sentences(found))]
        body.append(chart("laws-chart", "On the line: as predicted. Another machine than that of the laws shifts all."))
        header = [
            "form",
            "solver",
            "runs",
            "measured over predicted, median",
            "farthest from 1",
            "in the 95 % interval",
        ]
        body.append(table(header, _rows(found), range(2, 6)))
    else:
        body.append(missing("Measured runs of methods that have a law are", "polhode bench"))
    return Page("laws", TITLE, LEAD, "".join(body), tuple(commands), (_source(laws),), data, SCRIPTS)


def _sentences(found: list[Compared]) -> list[str]:
    ratios = [each.seconds / each.predicted.predicted for each in found]
    near = sum(0.5 <= ratio <= 2 for ratio in ratios) / len(ratios)
    inside = sum(each.inside for each in found) / len(found)
    return [
        f"{len(found)} runs, the hard cases among them: {near:.0%} took between half and twice the time predicted, "
        f"{inside:.0%} lie in the 95 % interval, and the median run took {median(ratios):.2f} times as long.",
    ]


def _judged(rows: tuple[Record, ...]) -> list[str]:
    """How good the predictions were."""
    timed = [row for row in rows if row[PACED] and row["seconds_predicted"]]
    bounded = [row for row in rows if row["slow_error"] is not None and row["slow_error_high"] is not None]

    def close(column: str) -> float:
        within = [1 / FACTOR <= row[column] / row["seconds_predicted"] <= FACTOR for row in timed]
        return sum(within) / len(within)

    lines = []
    if timed:
        lines.append(
            f"{close(PACED):.1%} of {len(timed)} times were predicted within a factor {FACTOR:g} at the usual pace, "
            f"{close('seconds'):.1%} as timed."
        )
    if bounded:
        share = sum(row["slow_error"] <= row["slow_error_high"] for row in bounded) / len(bounded)
        lines.append(
            f"{share:.1%} of {len(bounded)} errors stayed below the upper end of their interval (meant: 97.5 %)."
        )
    return lines


def _held_out(rows: tuple[Record, ...], predicted: str, measured: str, label: str) -> dict:
    series: dict[str, list] = {}
    known = [row for row in rows if (row[measured] or 0) > 0 and (row[predicted] or 0) > 0]
    number = duration if measured == PACED else scientific
    for row in known[:: -(-len(known) // MOST_POINTS) or 1]:
        tip = (
            f"{row['form']}, {row['solver']}, tolerance {short(row['tolerance'])}\n{row['scene']}\n"
            f"measured {number(row[measured])}\npredicted {number(row[predicted])}"
        )
        series.setdefault(row["solver"], []).append([row[predicted], row[measured], tip])
    ends = [min(row[measured] for row in known), max(row[measured] for row in known)] if known else DECADES
    return _scatter(series, label, (ends[0], ends[1]))


def compare(study: StudyRecords, laws: Laws, tell: Callable[[str], None]) -> list[Compared]:
    """Predictions for all runs of a study that were timed, of methods that have a law."""
    found = []
    for content, scene in study.scenes().items():
        own = [record for record in study.records if _content(record) == content and record.get("seconds")]
        own = [
            record for record in own if (record["form"], record["solver"]) in laws.methods and record["form"] in FORMS
        ]
        if not own:
            continue
        tell(f"laws: {own[0]['scene_name']}, St = {scene.stokes:g}")
        guide = _pilot(scene)
        if guide is None:
            continue
        for record in own:
            try:
                load = load_of(find_form(record["form"]), record["solver"], guide, record["samples"])
            except PilotFailedError:
                continue
            predicted = laws.methods[record["form"], record["solver"]].cost.predict(load, record["tolerance"])
            method = record["form"], record["solver"], record["tolerance"]
            seconds = laws.pace.seconds(record)
            found.append(Compared(record["scene_name"], scene.stokes, *method, seconds, predicted))
    return found


def _content(record: dict) -> str:
    return json.dumps(record.get("scene"), sort_keys=True)


def _pilot(scene: Scene) -> Pilot | None:
    try:
        return pilot(scene)
    except PilotFailedError:
        return None


def _rows(found: list[Compared]) -> list[list[str]]:
    methods: dict[tuple[str, str], list[Compared]] = {}
    for each in found:
        methods.setdefault((each.form, each.solver), []).append(each)
    rows = []
    for form, solver in sorted(methods, key=lambda method: (list(FORMS).index(method[0]), _place(method[1]))):
        own = methods[form, solver]
        ratios = [each.seconds / each.predicted.predicted for each in own]
        worst = max(ratios, key=lambda ratio: abs(log10(ratio)))
        inside = sum(each.inside for each in own) / len(own)
        rows.append([form, solver, str(len(own)), f"{median(ratios):.2f}", _ratio(worst), f"{inside:.0%}"])
    return rows


def _ratio(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def _place(solver: str) -> int:
    """Place in the catalogue."""
    return list(SOLVERS).index(solver) if solver in SOLVERS else len(SOLVERS)


def _chart(found: list[Compared]) -> dict:
    series: dict[str, list] = {}
    for each in found[:: -(-len(found) // MOST_POINTS)]:
        series.setdefault(each.solver, []).append([each.predicted.predicted, each.seconds, _tip(each)])
    return _scatter(series, "time, s", DECADES)


def _scatter(points: dict[str, list], label: str, ends: tuple[float, float]) -> dict:
    """Diagram of measured against predicted values, one series per solver, and the line on which they agree."""
    counts: dict[str, int] = {}
    series = []
    for solver in sorted(points, key=_place):
        library = find_solver(solver).family
        mark = MARKERS[counts.get(library, 0) % len(MARKERS)]
        counts[library] = counts.get(library, 0) + 1
        series.append({"name": solver, "color": colour_of(solver), "mark": mark, "points": points[solver]})
    return {
        "label": f"Measured against predicted: {label}",
        "x": {"label": f"predicted {label}", "log": True},
        "y": {"label": f"measured {label}", "log": True},
        "series": series,
        "legend": True,
        "lines": [{"points": [[end, end] for end in ends], "color": "#666"}],
    }


def _tip(each: Compared) -> str:
    low, high = duration(each.predicted.low), duration(each.predicted.high)
    return (
        f"{each.form}, {each.solver}, tolerance {short(each.tolerance)}\n{each.scene}, St = {short(each.stokes)}\n"
        f"measured {duration(each.seconds)}\npredicted {duration(each.predicted.predicted)} ({low} … {high})"
    )


def _source(laws: Laws) -> str:
    machine = laws.source.get("machine")
    place = machine.get("processor") if isinstance(machine, dict) else machine
    packages = laws.source.get("versions")
    versions = ", ".join(f"{name} {number}" for name, number in packages.items()) if isinstance(packages, dict) else ""
    fitted = f", fitted on {place}" if place else ""
    return f"Laws of {len(laws.methods)} methods{fitted}{f' ({versions})' if versions else ''}."
