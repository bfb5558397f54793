"""The held-out test, run: `pick` asked about scenes that no law was fitted on, and what it said measured."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf
from time import perf_counter

import pandas as pd

from polhode.harness.calibration.evaluation import (
    Answer,
    Evaluation,
    error_of,
    judged,
    predicted_runs,
)
from polhode.harness.calibration.scenes import STRATA, Question, Stratum, questions
from polhode.harness.calibration.selection import CUTOFF, decade, rules, runs_of
from polhode.harness.calibration.training import REFERENCE_SECONDS, methods_for, study
from polhode.harness.common.store import Record, Store
from polhode.harness.picking.laws import Laws
from polhode.harness.picking.pilot import PilotFailedError, form_ladder, pilot
from polhode.harness.picking.ranking import NotAttainableError, pick
from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.references.reference import MOST_ROTATIONS, reference
from polhode.harness.studies.case import Case
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import Study
from polhode.models.catalogue import reference_form
from polhode.models.spent import SPENT
from polhode.solvers.contract import Status

# Every fast method is measured at tolerances by tens, from ten times the error asked for, to find
# the best choice.
DECADES = (1, 0, -1, -2, -3)
LOOSEST, TIGHTEST = -3, -14
# So many of the cheapest that meet the error, and the first choice, are timed once more, in turns:
# the cheapest of a hundred noisy times is the luckiest one, and what disturbed the first choice did
# not disturb the others.
FINALISTS, FINAL = 5, "-final"
# A reference is to know an error asked for to this part of it.
KNOWN = 3.0
# Seconds that every run may take, however short the first choice is.
SHORTEST_LIMIT = 0.1


def evaluate(
    store: Store, laws: Laws, count: int, quiet: bool, seed: int, seeds: int
) -> Evaluation:
    """Ask `pick` about `count` held-out scenes of each seed, of both strata, measure them into a store, and compare."""
    answers, left_out = [], dict[str, str]()
    for each in range(seed, seed + seeds):
        for stratum in STRATA:
            drawn = affordable(each, -(-count // 2), stratum, left_out)
            answers += [ask(question, laws, stratum) for question in drawn]
    runner = Runner(store, quiet)
    batches = [batch for answer in answers for part in studies(answer) for batch in part.batches()]
    records = runner.run_batches("held-out", batches)
    last = runner.run_batches("finals", [finalists(answer, records) for answer in answers])
    judgements, ways = [], []
    for answer in answers:
        mine = [record for record in records if record["scene_name"] == answer.question.name]
        ways += runs_of(answer.question, answer.stratum, mine, answer.first_choice(mine))
        finals = [record for record in last if record["scene_name"] == answer.question.name + FINAL]
        judgements.append(judged(answer, finals))
    asked = {answer.question.name: answer.question for answer in answers}
    return Evaluation(
        pd.DataFrame(judgements), predicted_runs(records, laws), pd.DataFrame(ways), asked, left_out
    )


def affordable(seed: int, count: int, stratum: Stratum, left_out: dict[str, str]) -> list[Question]:
    """The first questions of a stratum that have a reference within its budget; why others are left out."""
    found: list[Question] = []
    for each in questions(seed, 4 * count, stratum):
        if len(found) == count:
            break
        if reason := no_reference(each):
            left_out[each.name] = reason
        else:
            found.append(each)
    return found


def no_reference(question: Question) -> str:
    """Why a question has no reference within its budget; empty if it has one."""
    scene = question.scene
    try:
        if pilot(scene).rotations > MOST_ROTATIONS:
            return f"more than {MOST_ROTATIONS:g} rotations"
        known = reference(scene, reference_form(scene), question.samples, REFERENCE_SECONDS)
    except PilotFailedError as failure:
        return str(failure)
    except ReferenceFailedError as failure:
        late = failure.status == Status.TIME_LIMIT
        return (
            f"its reference takes more than {REFERENCE_SECONDS:g} s"
            if late
            else "its reference is not certified"
        )
    unknown = known.slow_uncertainty if question.want == "slow" else known.orientation_uncertainty
    return (
        "its reference is not known well enough"
        if KNOWN * (unknown or 0.0) > question.error
        else ""
    )


def ask(question: Question, laws: Laws, stratum: Stratum = "short") -> Answer:
    """What `pick` says, and what that costs with everything compiled."""
    pilot.cache_clear()
    form_ladder.cache_clear()
    began, compiling = perf_counter(), SPENT.seconds["compilation"]
    found, refusal = None, ""
    try:
        found = pick(question.scene, question.error, question.want, question.samples, laws)
    except NotAttainableError as not_attainable:
        refusal = str(not_attainable)
    return Answer(
        question,
        found,
        refusal,
        stratum,
        perf_counter() - began - (SPENT.seconds["compilation"] - compiling),
    )


def studies(answer: Answer) -> Iterator[Study]:
    """What is measured of a held-out scene: the first choice, and every fast method at tolerances by tens."""
    question = answer.question
    known, most = pilot(question.scene), inf
    if answer.recommendation is not None:
        first = answer.recommendation.ranking[0]
        yield study(question, first.form, [first.solver], (first.tolerance,), known.rotations)
        # What takes much longer than the first choice, counting included, is not the best.
        most = max(SHORTEST_LIMIT, CUTOFF * first.seconds.high)
    wanted: dict[tuple[int, str], list[str]] = {}
    for power in {min(LOOSEST, max(TIGHTEST, decade(question) + shift)) for shift in DECADES}:
        for form, solvers in methods_for(
            known, float(f"1e{power}"), answer.stratum == "short", True
        ):
            wanted[power, form] = solvers
    for form, solver, shift in (way.split("/") for way in rules(question)):
        # Simple rules are measured too where their method is none that may win.
        place = decade(question) + int(shift), form
        wanted[place] = list(dict.fromkeys([*wanted.get(place, []), solver]))
    for (power, form), solvers in sorted(wanted.items(), key=lambda each: -each[0][0]):
        part = study(question, form, solvers, (float(f"1e{power}"),), known.rotations)
        yield replace(part, max_seconds=min(most, part.max_seconds))


def finalists(answer: Answer, records: Sequence[Record]) -> list[Case]:
    """The first choice and the cheapest runs that meet the error, to be timed once more; without what failed."""
    question = answer.question
    mine = [
        record
        for record in records
        if record["scene_name"] == question.name and "seconds" in record
    ]
    good = sorted(
        (r for r in mine if error_of(r, question.want) <= question.error),
        key=lambda r: r["seconds"],
    )
    first = answer.first_choice(mine)
    chosen = (
        good[:FINALISTS]
        if first is None
        else [first, *(r for r in good[:FINALISTS] if r is not first)]
    )
    names = "form", "solver", "tolerance", "samples", "max_seconds"
    limits = {"reference_seconds": REFERENCE_SECONDS, "counted": False}
    ways = ([record[name] for name in names] for record in chosen)
    return [Case(question.name + FINAL, question.scene, *way, **limits) for way in ways]
