"""`pick` without each part of its race in turn: what the part buys, and what it costs.

A part is left out by another value of one constant or function. On each scene held out the choices of all
these races are timed in turns, beside the choice with all parts, and their errors are measured. A part that
changes no choice for the better, and spares no time of asking, is not needed. A row is what one race chose on
one scene.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from math import inf, nan
from types import ModuleType
from typing import Any, NamedTuple

from polhode.harness.answers import forecast, race, rules, tolerances
from polhode.harness.answers.heldout import NEAR, Track, ask, reference_of
from polhode.harness.answers.questions import Question, questions
from polhode.harness.common.files import digest
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record, Store
from polhode.harness.references.extended import ReferenceFailedError

# The name of the race that nothing is left out of.
ALL_PARTS = "nothing"
# Version of the rows in the store: rows of another one are measured anew.
_SCHEMA = 2
# So large that no cost and no number of steps exceeds it.
_ANY = 1e12


class Part(NamedTuple):
    """A part of a race, and how to leave it out."""

    words: str  # what the part does
    place: ModuleType | type  # a module or a class
    name: str  # of a constant or a function there
    without: Any  # its value where the part is left out


def _always(value: Any) -> Callable[..., Any]:
    """A function of any arguments that gives one value."""
    return lambda *_: value


RACE_PARTS = (
    Part(f"a run is stopped that costs {race.TIED:g} times the best", race, "TIED", _ANY),
    Part("a method runs at up to two tolerances", race, "_MAX_RUNS", 1),
    Part("a run of a small error is made again at a looser tolerance", race, "_LEAST_SHARE", 0.0),
    Part("an averaged run far from the error is not made again", race, "_HOPELESS", inf),
    Part("tables of triaxial shapes need a run of many steps", race, "_TABLED_FROM", 0),
    Part("averaging needs a run of some thousand steps", race, "AVERAGED_FROM", 0),
    Part("averaging needs a St at which few bodies err by more", race, "few_error", _always(0.0)),
    Part("splitting of few steps comes first", race, "_FEW_STEPS", 0),
    Part("the quickest forecast is run on the scene itself", race.Heat, "settle", _always(None)),
    Part("refused averaged runs are looked at again", race.Heat, "look_again", _always(None)),
    Part("hybrid needs a plan that averages", race, "_MOST_IN_FULL", inf),
    Part("implicit methods need many damping times", race, "_IMPLICIT_FROM", 0.0),
    Part("two runs tell of the tolerances between", tolerances, "_FAR", 0.0),
    Part("a run of a small share of the error is loosened", tolerances, "_LEAST_SHARE", 0.0),
    Part("a surrogate keeps 25 rotations in a damping time", forecast, "_FAST", 0.0),
    Part("DOP853 takes Verner's place near rounding", rules, "_ROUNDED_SHARE", inf),
)


@contextmanager
def left_out(part: Part) -> Iterator[None]:
    """Leave a part out of all races meanwhile."""
    kept = getattr(part.place, part.name)
    setattr(part.place, part.name, part.without)
    try:
        yield
    finally:
        setattr(part.place, part.name, kept)


def study(store: Store, seed: int, count: int, quiet: bool = False) -> list[Record]:
    """Race random scenes with all parts and without each, into a store; a row for each scene and race.

    Keys: `scene`; `without`, the words of the part or `ALL_PARTS`; `choice`, form, solver and tolerance in a
    line, empty where the error is refused; `seconds` and `error` of the choice, NaN without one; `met`,
    whether it met the error requested; `asking` in seconds. Scenes without a reference are left out.
    """
    rows: list[Record] = []
    bar = Steps("ablation", count, "scenes", quiet).over(questions(seed, count))
    for number, question in enumerate(bar):
        content = {"ablation": question.name, "schema": _SCHEMA}
        make = partial(measured, question, number)
        rows += store.made_once(digest(content), content, make)["rows"]
    return rows


def measured(question: Question, first: int = 0) -> Record:
    """The rows of one scene, under "rows"; none where it has no reference.

    The race with all parts and those without one take turns; which of them begins, `first` says. It changes
    from scene to scene, so that none always finds what the others have cached.
    """
    try:
        track = Track(question, reference_of(question))
    except (ReferenceFailedError, ValueError):
        return {"rows": []}
    asked = {}
    races: list[Part | None] = [None, *RACE_PARTS]
    for place in range(len(races)):
        part = races[(first + place) % len(races)]
        with left_out(part) if part else nullcontext():
            asked[part.words if part else ALL_PARTS] = ask(question)
    choices = {}
    for words, (answer, _, _) in asked.items():
        if answer:
            quickest = answer.ranking[0]
            choices[words] = quickest.form, quickest.solver, quickest.tolerance
    timed = track.in_turns([*dict.fromkeys(choices.values())])
    rows = []
    for words, (_, _, asking) in asked.items():
        choice = choices.get(words)
        run = timed[choice] if choice else {"seconds": nan, "error": nan, "met": False}
        rows.append(
            {
                "scene": question.name,
                "without": words,
                "choice": " ".join(map(str, choice)) if choice else "",
                "seconds": run["seconds"],
                "error": run["error"],
                "met": run["met"],
                "asking": asking,
            }
        )
    return {"rows": rows}


def compared(rows: Any) -> list[Record]:
    """For each part, the races without it beside those with all parts, from the data frame of all rows.

    `changed` counts the scenes with another choice. `slower` and `quicker` count those where the choice takes
    `NEAR` times as long or more, and the other way round; both met the error. `lost` and `won` count those
    where the choice misses the error and the one with all parts meets it, and the other way round. `asking`
    is the median ratio of the seconds of asking, `asking_all` the ratio of their sums.
    """
    scenes = rows.pivot(
        index="scene", columns="without", values=["seconds", "met", "asking", "choice"]
    )
    complete = scenes.xs(ALL_PARTS, axis="columns", level="without")
    comparisons = []
    for part in RACE_PARTS:
        if part.words not in scenes["choice"]:
            continue
        reduced = scenes.xs(part.words, axis="columns", level="without")
        met = reduced["met"].astype(bool)
        complete_met = complete["met"].astype(bool)
        ratio = (reduced["seconds"] / complete["seconds"]).astype(float)
        asking = (reduced["asking"] / complete["asking"]).astype(float)
        comparisons.append(
            {
                "part": part.words,
                "changed": int((reduced["choice"] != complete["choice"]).sum()),
                "slower": int((met & complete_met & (ratio >= NEAR)).sum()),
                "quicker": int((met & complete_met & (ratio <= 1 / NEAR)).sum()),
                "lost": int((complete_met & ~met).sum()),
                "won": int((met & ~complete_met).sum()),
                "asking": float(asking.median()),
                "asking_all": float(reduced["asking"].sum() / complete["asking"].sum()),
            }
        )
    return comparisons
