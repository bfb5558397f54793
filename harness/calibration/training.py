"""What is measured to fit the laws: random scenes, by every form that accepts them and every solver, as studies."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from polhode.harness.calibration.scenes import TRAINING_SCENES, TRAINING_SEED, Question, questions
from polhode.harness.common.store import Record, Store
from polhode.harness.picking.laws import Laws
from polhode.harness.picking.model_error import LEAST_ROTATIONS
from polhode.harness.picking.pilot import ANGLES, InPieces, damping_times, pilot
from polhode.harness.studies.case import Case
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import Study
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.catalogue import solver as find_solver

# One tolerance of each row for every scene: laws need the whole range, not all of it everywhere.
LADDER = ((1e-3, 1e-4, 1e-5), (1e-6, 1e-7, 1e-8), (1e-9, 1e-10, 1e-11), (1e-12, 1e-13, 1e-14))
# Methods of low order take forever at tight tolerances: they get rows of the ladder before this one.
LOW_ORDER_ROWS = 3
# Explicit methods are held back by stability: beyond this many damping times they are measured no more, and beyond a
# tenth of it at their loosest tolerances alone.
MOST_EXPLICIT = 2e5
# Angles only stand where something better does: they are measured on every third scene, on some rows of the ladder.
ANGLES_EVERY, ANGLES_ROWS = 3, (0, 2)
# Solvers with Python in the loop: measured on every fourth scene, at two tolerances, to show where they stand; on every
# second one in averaged forms, whose cost does not grow with the rotations.
ASIDE_EVERY, ASIDE_ROTATIONS, ASIDE_AVERAGED_EVERY = 4, 300.0, 2
# Of the long stratum are measured runs of so many rotations at most, by all methods up to the first number, and by some
# beyond it; beside so many scenes of the short one there is one of the long one.
EVERY_LONG, MOST_LONG, LONG_SHARE = 2e3, 2e4, 3
QUICK = ("taylor", "cyrk-vern8", "cyrk-dop853", "splitting", "stroboscopic")
# Counting right-hand sides slows compiled solvers down some thirtyfold, within the same limit of time.
SECONDS, SECONDS_PER_ROTATION = 1.0, 1e-3


def fast_solvers() -> list[str]:
    """Solvers without Python in the loop."""
    return [name for name in SOLVERS if "compiled" in find_solver(name).backends]


def solvers_for(scene: Scene, row: int) -> list[str]:
    """Fast solvers worth measuring on a scene at tolerances of a row of the ladder."""
    stiff = damping_times(scene)
    chosen = []
    for name in fast_solvers():
        slow = not find_solver(name).implicit and (stiff > MOST_EXPLICIT or (stiff > MOST_EXPLICIT / 10 and row > 0))
        if not slow and not (find_solver(name).low_order and row >= LOW_ORDER_ROWS):
            chosen.append(name)
    return chosen


def forms_for(scene: Scene, rotations: float) -> list[str]:
    """Forms that accept a scene and are soon prepared; averaged ones only where there is something to average over."""
    accepted = []
    for name in FORMS:
        form = find_form(name)
        try:
            form.problem(scene)
        except FormNotValidError:
            continue
        if not (form.averaged or isinstance(form, InPieces)) or rotations > LEAST_ROTATIONS * damping_times(scene):
            accepted.append(name)
    return accepted


def lacking(base: Laws, form: str, solver: str) -> bool:
    """Whether laws know nothing of a method, or what was true once."""
    law = base.methods.get((form, solver))
    return law is None or law.stale


def missing_studies(question: Question, index: int, base: Laws) -> Iterator[Study]:
    """What is measured of a training scene by the methods that the laws lack."""
    for whole in studies(question, index):
        for form in whole.forms:
            if solvers := tuple(solver for solver in whole.solvers if lacking(base, form, solver)):
                yield replace(whole, forms=(form,), solvers=solvers)


def long_studies(question: Question, index: int) -> Iterator[Study]:
    """What is measured of a training scene of the long stratum."""
    scene, random = question.scene, np.random.default_rng((TRAINING_SEED, index, 2))
    rotations = pilot(scene).rotations
    if rotations > MOST_LONG:
        return
    forms = [name for name in forms_for(scene, rotations) if name not in ANGLES]
    for row, choices in enumerate(LADDER):
        tolerance, solvers = float(random.choice(choices)), solvers_for(scene, row)
        for name in forms:
            fit = solvers if rotations < EVERY_LONG or find_form(name).averaged else [s for s in solvers if s in QUICK]
            yield study(question, [name], fit, (tolerance,), rotations)


def studies(question: Question, index: int) -> Iterator[Study]:
    """What is measured of one training scene."""
    scene, random = question.scene, np.random.default_rng((TRAINING_SEED, index, 1))
    rotations = pilot(scene).rotations
    forms = forms_for(scene, rotations)
    plain = [name for name in forms if name not in ANGLES]
    for row, choices in enumerate(LADDER):
        tolerance = float(random.choice(choices))
        chosen = forms if index % ANGLES_EVERY == 0 and row in ANGLES_ROWS else plain
        yield study(question, chosen, solvers_for(scene, row), (tolerance,), rotations)
    slow = []
    if index % ASIDE_EVERY == 0 and rotations < ASIDE_ROTATIONS:
        slow = plain
    elif index % ASIDE_AVERAGED_EVERY == 0:
        slow = [name for name in plain if find_form(name).averaged]
    if slow:
        aside = [name for name in SOLVERS if name not in fast_solvers()]
        if damping_times(scene) > MOST_EXPLICIT / 10:
            aside = [name for name in aside if find_solver(name).implicit]
        tolerances = tuple(float(random.choice(choices)) for choices in LADDER[:2])
        yield study(question, slow, aside, tolerances, rotations)


def study(
    question: Question, forms: list[str], solvers: list[str], tolerances: tuple[float, ...], rotations: float
) -> Study:
    """One scene by some forms, solvers and tolerances."""
    return Study(
        name=question.name,
        title=question.name,
        scenes=((question.name, question.scene),),
        forms=tuple(forms),
        solvers=tuple(solvers),
        tolerances=tolerances,
        samples=question.samples,
        max_seconds=SECONDS + SECONDS_PER_ROTATION * round(rotations, -3),
    )


@dataclass(frozen=True)
class CaseGroups:
    """Cases in batches, those of a batch measured in turns."""

    name: str
    groups: tuple[list[Case], ...]

    @classmethod
    def of(cls, name: str, studies: Iterable[Study]) -> Self:
        """The batches of several studies."""
        return cls(name, tuple(batch for study in studies for batch in study.batches()))

    def batches(self) -> Iterator[list[Case]]:
        """The groups."""
        return iter(self.groups)


def training(count: int = TRAINING_SCENES, base: Laws | None = None) -> CaseGroups:
    """All that is measured of the training scenes, or what laws lack of it, and of a third as many long ones."""
    parts: list[Study] = []
    for index, question in enumerate(questions(TRAINING_SEED, count)):
        parts += missing_studies(question, index, base) if base else studies(question, index)
    for index, question in enumerate(questions(TRAINING_SEED, count // LONG_SHARE, "long")):
        parts += long_studies(question, index)
    return CaseGroups.of("training", parts)


def train(store: Store, count: int = TRAINING_SCENES, quiet: bool = False, base: Laws | None = None) -> list[Record]:
    """Records of the training scenes, measured into a store where it does not hold them."""
    return Runner(store, quiet).run(training(count, base))
