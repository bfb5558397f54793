"""`pick` in the language of algorithm selection: against the best of all ways, the best single one, and simple rules.

An algorithm is a form, a solver and a rule for the tolerance: so many powers of ten from the error
asked for. Its performance on a scene is its time over the shortest time in which any way met the
error; ways that miss the error or take longer than `CUTOFF` times the shortest count `PENALTY`
times that (PAR10). Source: Bischl et al., ASlib: A benchmark library for algorithm selection,
Artificial Intelligence 237 (2016) 41.
"""

from collections.abc import Sequence
from math import log10
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.answers.rules import simplest
from polhode.harness.calibration.evaluation import error_of
from polhode.harness.calibration.scenes import Question
from polhode.harness.common.store import Record
from polhode.harness.references.rotations import STIFF, damping_times
from polhode.solvers.contract import Status

CUTOFF, PENALTY = 30.0, 10.0
PICK, SINGLE = "pick", "single best"
FEATURES = (
    "log_stokes",
    "log_time",
    "middle_axis",
    "short_axis",
    "speed",
    "log_error",
    "orientation",
    "samples",
)
COLUMNS = ("instance", "stratum", "algorithm", "seconds", "met")


def decade(question: Question) -> int:
    """The power of ten next to the error asked for."""
    return round(log10(question.error))


def runs_of(
    question: Question, stratum: str, records: Sequence[Record], first: Record | None
) -> list[dict[str, Any]]:
    """Every way measured on a scene, simple rules, and `pick`'s: time, and whether it met the error."""
    ways: dict[str, Record | None] = {}
    for record in records:
        power = log10(record["tolerance"])
        if abs(power - round(power)) < 1e-6:
            ways[f"{record['form']}/{record['solver']}/{round(power) - decade(question):+d}"] = (
                record
            )
    named = {rule: ways.get(way) for way, rule in rules(question).items()}
    return [
        dict(
            zip(
                COLUMNS,
                (question.name, stratum, name, *_performance(record, question)),
                strict=True,
            )
        )
        for name, record in (ways | named | {PICK: first}).items()
    ]


def rules(question: Question) -> dict[str, str]:
    """What simple rules would run: the algorithm's name, and the rule's."""
    scene = question.scene
    form = simplest(scene)
    # SciML's: Tsit5, below 1e-6 Vern7, an implicit method where it finds the scene stiff; the error
    # is the tolerance.
    explicit = "cyrk-tsit5" if question.error >= 1e-6 else "cyrk-vern7"
    default = "cyrk-radau" if damping_times(scene) > STIFF else explicit
    return {
        f"{form}/taylor/-1": "taylor at a tenth of the error",
        f"{form}/cyrk-lsoda/-2": "LSODA at a hundredth of the error",
        f"{form}/{default}/+0": "SciML's default",
    }


def _performance(record: Record | None, question: Question) -> tuple[float, bool]:
    if record is None or "seconds" not in record or record["status"] != Status.REACHED_END:
        return np.inf, False
    return float(record["seconds"]), error_of(record, question.want) <= question.error


def penalised(runs: Any) -> Any:
    """Performance, a row for each scene that any way solves, a column for each algorithm."""
    best = runs[runs["met"]].groupby("instance")["seconds"].min()
    table = runs.pivot_table(
        index="instance", columns="algorithm", values="seconds", aggfunc="min", dropna=False
    )
    met = runs.pivot_table(
        index="instance", columns="algorithm", values="met", aggfunc="max", dropna=False
    )
    ratio = table.loc[best.index].div(best, axis=0)
    solved = met.loc[best.index].fillna(False).astype(bool) & (ratio <= CUTOFF)
    return ratio.where(solved, PENALTY * CUTOFF)


def _single_best(table: Any) -> str:
    return table.filter(like="/").mean().idxmin()


def scores(runs: Any) -> pd.DataFrame:
    """Of `pick`, the single best algorithm and each rule, per stratum: PAR10, shares of scenes, and the gap closed."""
    parts = []
    for stratum, mine in [("both", runs), *runs.groupby("stratum")]:
        table = penalised(mine)
        if table.empty:  # No way met the error of any of these scenes.
            continue
        single = _single_best(table)
        ways = table[[*(name for name in table if "/" not in name), single]]
        means = ways.mean()
        gap = means[single] - 1  # from the single best algorithm to the virtual best one
        shares = {"solved": ways < PENALTY * CUTOFF, "within": ways <= 1.5, "above": ways > 5}
        columns = {"par10": means} | {name: true.mean() for name, true in shares.items()}
        columns["gap_closed"] = (means[single] - means) / gap if gap > 0 else np.nan
        part = (
            pd.DataFrame(columns)
            .rename(index={single: f"{SINGLE}: {single}"})
            .reset_index(names="way")
        )
        parts.append(part.assign(stratum=stratum, scenes=len(table)))
    return pd.concat(parts, ignore_index=True)


def pays_from(scenes: Any, runs: Any) -> float:
    """Seconds of a run by the single best algorithm from which on asking `pick` saves more than it costs, or inf."""
    single = _single_best(penalised(runs))
    usual = runs[runs["algorithm"] == single].set_index("instance")["seconds"].rename("usual")
    mine = (
        scenes.set_index("scene")[["seconds", "pick_seconds"]]
        .join(usual)
        .dropna()
        .sort_values("usual")
    )
    saves = (mine["usual"] - mine["seconds"] - mine["pick_seconds"] > 0).to_numpy()
    # From there on more than half of the scenes are quicker with `pick`, its own time included.
    tails = [saves[i:].mean() > 0.5 for i in range(len(saves))]
    lasting = [all(tails[i:]) for i in range(len(tails))]
    return float(mine["usual"].iloc[lasting.index(True)]) if True in lasting else np.inf


def features(question: Question) -> tuple[float, ...]:
    """What is known of a scene before anything is run; 0 and inf as St count as 1e-10 and 1e10."""
    scene = question.scene
    longest, middle, short = sorted(scene.ellipsoid.semi_axes, reverse=True)
    stokes = min(max(scene.stokes, 1e-10), 1e10)
    speed = float(np.linalg.norm(scene.angular_velocity))
    numbers = (
        log10(stokes),
        log10(scene.time),
        middle / longest,
        short / longest,
        speed,
        log10(question.error),
    )
    return (*numbers, float(question.want == "orientation"), float(question.samples))
