"""The held-out test, run: `pick` asked about scenes that no law was fitted on, and what it said measured."""

from collections.abc import Sequence
from math import log10

import pandas as pd

from polhode.harness.calibration.evaluation import Answer, Evaluation, error_of, judged, predicted_runs
from polhode.harness.calibration.scenes import HELD_OUT_SCENES, HELD_OUT_SEED, Question, questions
from polhode.harness.calibration.training import CaseGroups, fast_solvers, forms_for, solvers_for, study
from polhode.harness.common.store import Record, Store
from polhode.harness.picking.laws import Laws
from polhode.harness.picking.pilot import pilot
from polhode.harness.picking.ranking import NotAttainableError, pick
from polhode.harness.studies.case import Case
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import Study

# Every fast method is measured at tolerances by tens, from ten times the error asked for, to find the best choice.
DECADES = (1, 0, -1, -2, -3, -4, -5)
LOOSEST, TIGHTEST = -3, -14
# So many of the cheapest that meet the error, and the first choice, are timed once more, in turns: the cheapest of a
# hundred noisy times is the luckiest one, and what disturbed the first choice did not disturb the others.
FINALISTS, FINAL = 5, "-final"


def evaluate(
    store: Store, laws: Laws, count: int = HELD_OUT_SCENES, quiet: bool = False, seed: int = HELD_OUT_SEED
) -> Evaluation:
    """Ask `pick` about the held-out scenes, measure them into a store, and compare."""
    answers = [ask(question, laws) for question in questions(seed, count)]
    runner = Runner(store, quiet)
    records = runner.run(CaseGroups.of("held-out", (each for answer in answers for each in studies(answer))))
    last = runner.run(CaseGroups("finals", tuple(finalists(answer, records) for answer in answers)))
    finals = [[record for record in last if record["scene_name"] == answer.question.name + FINAL] for answer in answers]
    return Evaluation(pd.DataFrame(map(judged, answers, finals)), predicted_runs(records, laws))


def ask(question: Question, laws: Laws) -> Answer:
    """What `pick` says."""
    try:
        found = pick(question.scene, question.error, question.want, question.samples, laws)
    except NotAttainableError as refusal:
        return Answer(question, None, str(refusal))
    return Answer(question, found, "")


def studies(answer: Answer) -> list[Study]:
    """What is measured of a held-out scene: the first choice, and every fast method at tolerances by tens."""
    question = answer.question
    rotations = pilot(question.scene).rotations
    parts = []
    if answer.recommendation is not None:
        first = answer.recommendation.ranking[0]
        parts.append(study(question, [first.form], [first.solver], (first.tolerance,), rotations))
    forms = forms_for(question.scene, rotations)
    decade = round(log10(question.error))
    for power in sorted({min(LOOSEST, max(TIGHTEST, decade + shift)) for shift in DECADES}, reverse=True):
        # The row of the training ladder in which the tolerance stands.
        row = (-power - 3) // 3
        solvers = [name for name in solvers_for(question.scene, row) if name in fast_solvers()]
        parts.append(study(question, forms, solvers, (float(f"1e{power}"),), rotations))
    return parts


def finalists(answer: Answer, records: Sequence[Record]) -> list[Case]:
    """The first choice and the cheapest runs that meet the error, to be timed once more; without what failed."""
    question = answer.question
    mine = [record for record in records if record["scene_name"] == question.name and "seconds" in record]
    good = sorted((r for r in mine if error_of(r, question.want) <= question.error), key=lambda r: r["seconds"])
    first = answer.first_choice(mine)
    chosen = good[:FINALISTS] if first is None else [first, *(r for r in good[:FINALISTS] if r is not first)]
    names = "form", "solver", "tolerance", "samples", "max_seconds"
    return [Case(question.name + FINAL, question.scene, *(record[name] for name in names)) for record in chosen]
