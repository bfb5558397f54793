"""The page of `pick`: its laws, and how they did on scenes held out; tables, figures and data from the records."""

from math import inf, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from polhode.harness.calibration.evaluation import CHEAP, FACTOR, MEETS, PREDICTED, Evaluation, close
from polhode.harness.calibration.selection import CUTOFF, PENALTY, PICK, pays_from, scores, write_aslib
from polhode.harness.common.files import write_file
from polhode.harness.common.text import duration, markdown, scientific
from polhode.harness.pages.figures.style import family_colour
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.picking.laws import Laws, MethodLaws
from polhode.solvers.catalogue import solver as find_solver

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENES_HEADER = ["St", "shape", "N", "wanted", "error asked", "first choice", "error", "time", "over the best"]
SCENES_HEADER += ["best choice"]
LAWS_HEADER = ["form", "solver", "runs", "fixed, µs", "exponent", "per rotation, µs", "per damping time, ns"]
LAWS_HEADER += ["strays 95 %"]


def write_pages(folder: Path, laws: Laws, evaluation: Evaluation, command: str) -> Path:
    """Write the page, its figures and its tables into a folder and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    write_file(folder / "laws.csv", _law_frame(laws).to_csv(index=False), summed=True)
    write_file(folder / "scenes.csv", evaluation.scenes.to_csv(index=False), summed=True)
    runs = evaluation.runs.copy()
    for name in runs.columns[4:]:
        runs[name] = [f"{value:.4g}" if value == value else "" for value in runs[name]]
    write_file(folder / "runs.csv", runs.to_csv(index=False), summed=True)
    _write_figures(folder, evaluation)
    if evaluation.ways is not None:
        write_file(folder / "ways.csv", evaluation.ways.to_csv(index=False, float_format="%.4g"), summed=True)
        write_aslib(folder / "aslib", evaluation.questions, evaluation.ways)
    page = folder / "README.md"
    write_file(page, "\n".join(_lines(laws, evaluation, command)))
    return page


def summary(evaluation: Evaluation) -> list[str]:
    """The evaluation in sentences, each with its target."""
    count, shares = len(evaluation.scenes), evaluation.shares
    refused = sum(scene["refusal"] != "" for scene in evaluation.scenes.to_dict("records"))
    lines = [
        f"The first choice met the error on {shares['met']:.1%} of {count} held-out scenes (target: {MEETS:.1%}).",
        f"It cost at most {FACTOR:g} times the best measured choice on {shares['cheap']:.1%} (target: {CHEAP:.0%}).",
        f"The cost laws predicted {shares['predicted']:.1%} of {len(evaluation.runs)} held-out times "
        f"within a factor {FACTOR:g} (target: {PREDICTED:.0%}) after correcting for the machine's speed; "
        f"{shares['predicted as timed']:.1%} as timed.",
        f"The slow error stayed below the upper end of its interval in {shares['bounded']:.1%} of the runs "
        "(target: 97.5%).",
    ]
    lines.append(f"The dearest first choice cost {evaluation.scenes['factor'].max():.2g} times the best (target: 5).")
    if evaluation.ways is not None:
        table: Any = scores(evaluation.ways)
        gaps = [f"{row.gap_closed:.3f} ({row.stratum})" for row in table[table["way"] == PICK].itertuples()]
        lines.append(
            f"It closes {', '.join(gaps)} of the gap from the single best way to the virtual best (target: 0.95)."
        )
    if refused:
        lines.append(
            f"{refused} requests were refused as not attainable; they count as met if no measured run met them."
        )
    return lines


def _lines(laws: Laws, evaluation: Evaluation, command: str) -> list[str]:
    source = laws.source
    scenes = list(map(_scene_cells, evaluation.scenes.to_dict("records")))
    machine = source.get("machine", {})
    missed = [each for each in evaluation.scenes.to_dict("records") if each["miss"]]
    return [
        "# What `pick` promises, and what measuring showed",
        "",
        f"Made by `{command}`. Do not edit: the next run overwrites this page.",
        "",
        f"The laws were fitted on {source['records']} runs of {source['scenes']} random scenes, on "
        f"{machine.get('processor', 'an unnamed processor')}; the scenes below are others, from another seed.",
        "",
        *(f"- {sentence}" for sentence in summary(evaluation)),
        "",
        "The best measured choice is the cheapest of all runs that met the error: compiled solvers on every form that "
        "accepts the scene, at tolerances by tens, and the first choice itself, except combinations that cannot win "
        "(explicit solvers over very many damping times, low orders at tight tolerances, averaged forms without "
        "rotations to average over). The five cheapest and the first choice were then timed once more, in turns; "
        "these times are compared.",
        "",
        "Predicted times hold for the machine's speed when the laws were fitted. A fixed piece of arithmetic, timed "
        "before every batch of runs, measures the speed, and measured times are corrected by it. Times of the first "
        "choice and the best one are as timed.",
        "",
        "![Predicted against measured times and errors of the held-out runs](predicted.png)",
        "",
        "![Error and cost of the first choice on each held-out scene](choices.png)",
        "",
        *_selection(evaluation),
        "## Misses",
        "",
        *[f"- {each['scene']}: {each['miss']}." for each in missed],
        "" if missed else "None.\n",
        "## The scenes",
        "",
        "N: rotations. – stands for what is not known: the error, if the first choice failed, falsely claimed success "
        "or has no reference; the time, if it failed; N, error and time, if the request was refused. *Over the best* "
        "is inf if the first choice failed and another run met the error.",
        "",
        markdown(SCENES_HEADER, scenes, right=(0, 2, 4, 6, 7, 8)),
        "## Times by method",
        "",
        markdown(
            ["form", "solver", "runs", f"within {FACTOR:g}", "median ratio"],
            _by_method(evaluation.runs),
            right=(2, 3, 4),
        ),
        "## The laws",
        "",
        "Seconds = fixed + per sample · m + tol^exponent (start + per rotation · N + per time · F) "
        "+ per damping time · S tol^stiff exponent; N rotations, S damping times, F time spent following the flow. "
        "Brackets hold 95 % of the fits to resampled scenes, strays 95 % of measured over predicted. All numbers, "
        "those of the error laws too, are in [laws.csv](laws.csv); `harness/picking/laws.py` says what each means.",
        "",
        markdown(LAWS_HEADER, list(map(_law_cells, laws.methods.values())), right=range(2, 8)),
    ]


def _selection(evaluation: Evaluation) -> list[str]:
    """`pick` beside the virtual best, the single best and simple rules, per stratum."""
    if evaluation.ways is None:
        return []
    table: Any = scores(evaluation.ways)
    rows = [
        [
            row.stratum,
            row.way,
            row.scenes,
            f"{row.par10:.2f}",
            *(f"{share:.1%}" for share in (row.solved, row.within, row.above)),
            f"{row.gap_closed:.3f}",
        ]
        for row in table.itertuples(index=False)
    ]
    scenes: Any = evaluation.scenes
    cost, pays = scenes["pick_seconds"].median(), pays_from(scenes, evaluation.ways)
    header = ["stratum", "way", "scenes", "PAR10", "solved", "within 1.5", "above 5", "gap closed"]
    return [
        "## Against the best, the single best and simple rules",
        "",
        "Times over that of the virtual best, the quickest way measured that met the error on a scene; a way that "
        f"missed it, or took more than {CUTOFF:g} times as long, counts {PENALTY * CUTOFF:g} (PAR10). The single best "
        "is the form, solver and power of ten from the error to the tolerance with the least PAR10; the gap closed is "
        "0 for it and 1 for the virtual best. [aslib/](aslib/) holds the scenario in ASlib's format.",
        "",
        f"Asking `pick` takes {duration(cost)} in the median, with everything compiled. "
        + (
            f"That pays for runs that take the single best {duration(pays)} or more."
            if pays < inf
            else "No run measured here is long enough for that to pay."
        ),
        "",
        markdown(header, rows, right=range(2, 8)),
    ]


def _scene_cells(row: Any) -> list[str]:
    def method(head: str) -> str:
        return f"{row[f'{head}form']}, {row[f'{head}solver']}, {row[f'{head}tolerance']:g}"

    return [
        f"{row['stokes']:.2g}",
        row["kind"],
        "–" if pd.isna(row["rotations"]) else f"{row['rotations']:.3g}",
        row["want"],
        scientific(row["error_asked"]),
        "not attainable" if pd.isna(row["form"]) else method(""),
        scientific(row["error"]),
        duration(row["seconds"]),
        f"{row['factor']:.2f}",
        "none" if pd.isna(row["best_form"]) else method("best_"),
    ]


def _law_cells(law: MethodLaws) -> list[str]:
    cost, intervals = law.cost, law.cost.intervals

    def cell(name: str, unit: float) -> str:
        low, high = intervals[name]
        return f"{getattr(cost, name) / unit:.2g} [{low / unit:.2g}, {high / unit:.2g}]"

    spread = cost.stray.around(1.0)
    return [
        law.form,
        law.solver,
        str(cost.records),
        cell("fixed", 1e-6),
        cell("exponent", 1.0),
        cell("per_rotation", 1e-6),
        cell("per_damping_time", 1e-9),
        f"{spread.low:.2f} … {spread.high:.2f}",
    ]


def _by_method(runs: Any) -> list[list[str]]:
    table = []
    for (form, solver), mine in runs.groupby(["form", "solver"]):
        measured = mine["seconds_at_usual_pace"]
        middle = (measured / mine["seconds_predicted"]).quantile(0.5, interpolation="higher")
        table.append([form, solver, str(len(mine)), f"{close(measured, mine).mean():.0%}", f"{middle:.2f}"])
    return table


def _law_frame(laws: Laws) -> pd.DataFrame:
    rows = []
    for law in laws.methods.values():
        for kind, one in {"cost": law.cost, **law.errors}.items():
            for name, (low, high) in one.intervals.items():
                rows.append((law.form, law.solver, kind, one.records, name, getattr(one, name), low, high))
    return pd.DataFrame(rows, columns=["form", "solver", "law", "runs", "parameter", "value", "low", "high"])


def _write_figures(folder: Path, evaluation: Evaluation) -> None:
    """Write `predicted.png` and `choices.png` into a folder."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 5.0))
    runs: Any = evaluation.runs
    scenes: Any = evaluation.scenes
    _against(left, runs, "seconds_at_usual_pace", "seconds_predicted", FACTOR)
    left.set(xlabel=f"measured time of a warm run, s (dotted: factor {FACTOR:g})", ylabel="predicted, s")
    _against(right, runs[runs["slow_error"] > 0], "slow_error", "slow_error_predicted", 10.0)
    measured = "measured slow error of the solver, over I_max (dotted: factor 10)"
    right.set(xlabel=measured, ylabel="predicted, middle of the interval")
    left.legend(frameon=False, fontsize=8, loc="upper left", markerscale=2)
    figure.tight_layout()
    save(figure, folder, "predicted")

    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6))
    left.set_yscale("log")
    _sorted(left, scenes["error"] / scenes["error_asked"], 1.0, "error of the first choice over the error asked for")
    _sorted(right, scenes["factor"], FACTOR, "time of the first choice over the best one measured")
    figure.tight_layout()
    save(figure, folder, "choices")


def _against(axes: "Axes", runs: Any, measured: str, predicted: str, band: float) -> None:
    """Draw what was predicted over what was measured, a colour for each library, with lines at a factor `band`."""
    known = runs.dropna(subset=[measured, predicted])
    for library, mine in known.groupby(known["solver"].map(lambda name: find_solver(name).family), sort=False):
        colour = family_colour(str(library))
        axes.loglog(mine[measured], mine[predicted], ".", markersize=2.5, alpha=0.5, color=colour, label=library)
    values = known[[measured, predicted]].to_numpy(float)
    ends = 10 ** (log10(values[values > 0].min()) - 0.2), 10 ** (log10(values.max()) + 0.2)
    axes.plot(ends, ends, color="0.3", linewidth=0.9)
    for factor in (band, 1 / band):
        axes.plot(ends, [end * factor for end in ends], color="0.3", linewidth=0.7, linestyle=":")
    axes.set(xlim=ends, ylim=ends)
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)


def _sorted(axes: "Axes", values: Any, limit: float, what: str) -> None:
    known = values[values < float("inf")].sort_values()
    axes.plot(range(1, len(known) + 1), known, "o", markersize=4, color="#0072B2")
    axes.axhline(limit, color="#D55E00", linewidth=1.0)
    axes.set(xlabel="held-out scene, sorted", ylabel=what)
    axes.grid(True, which="major", linewidth=0.4, alpha=0.5)
