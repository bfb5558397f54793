"""What is measured to fit the laws: random scenes, by every form that accepts them and every solver, as studies."""

from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from math import log10

import numpy as np

from polhode.harness.calibration import TRAINING_SCENES
from polhode.harness.calibration.scenes import STRATA, TRAINING_SEED, Question, Stratum, questions
from polhode.harness.common.store import Record, Store
from polhode.harness.picking.laws import Laws
from polhode.harness.picking.load import planned
from polhode.harness.picking.model_error import LEAST_ROTATIONS
from polhode.harness.picking.pilot import InPieces, Pilot, averages, pilot
from polhode.harness.references.rotations import damping_times
from polhode.harness.studies.case import Case
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import Study
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver

# One tolerance of each row for every scene: laws need the whole range, not all of it everywhere.
LADDER = ((1e-3, 1e-4, 1e-5), (1e-6, 1e-7, 1e-8), (1e-9, 1e-10, 1e-11), (1e-12, 1e-13, 1e-14))
# Methods of low order take forever at tight tolerances: they get rows of the ladder before this
# one.
LOW_ORDER_ROWS = 3
# Explicit methods are held back by stability: beyond this many damping times they are measured no
# more, and beyond a tenth of it at their loosest tolerances alone.
MOST_EXPLICIT = 2e5
# Angles only stand where something better does: they are measured on every third scene, on some
# rows of the ladder.
ANGLES_EVERY, ANGLES_ROWS = 3, (0, 2)
# Where nothing is stiff implicit solvers stand beside what is quicker: they are measured at every
# second row.
IMPLICIT_EVERY = 2
# Solvers with Python in the loop: measured on every fourth scene, at two tolerances, to show where
# they stand; on every second one in averaged forms, whose cost does not grow with the rotations.
ASIDE_EVERY, ASIDE_ROTATIONS, ASIDE_AVERAGED_EVERY = 4, 300.0, 2
# Of runs of more rotations than the first number slow methods are left out, than the second all but
# those whose cost hardly grows with them: of the others a few are measured at tolerances of some
# rows, up to the third number. A form of pieces has no more rotations in its windows than the
# second number.
EVERY_LONG, MOST_QUICK, MOST_FULL = 2e3, 2e4, 6e4
STEADY, STEADY_ROWS = ("taylor", "cyrk-vern8", "cyrk-dop853"), (1, 3)
# There is one scene of the long stratum beside so many of the short one.
LONG_SHARE = 2
# Seconds that a run may take, by its rotations, and at most.
SECONDS, SECONDS_PER_ROTATION, MOST_SECONDS = 1.0, 3e-4, 10.0
# That a reference may take: some seven for 1e4 rotations. Runs without one, as beyond 2e5, have
# times, and no errors.
REFERENCE_SECONDS = 120.0


def fast_solvers() -> list[str]:
    """Solvers without Python in the loop."""
    return [name for name in SOLVERS if "compiled" in find_solver(name).backends]


def solvers_for(scene: Scene, row: int) -> list[str]:
    """Fast solvers worth measuring on a scene at tolerances of a row of the ladder."""
    stiff = damping_times(scene)
    held = stiff > MOST_EXPLICIT or (stiff > MOST_EXPLICIT / 10 and row > 0)
    methods = {name: find_solver(name) for name in fast_solvers()}
    able = {name: each for name, each in methods.items() if each.implicit or not held}
    return [name for name, each in able.items() if not (each.low_order and row >= LOW_ORDER_ROWS)]


def forms_for(scene: Scene, rotations: float) -> list[str]:
    """Forms that accept a scene and are soon prepared; averaged ones only where there is something to average over."""
    accepted, fast = [], rotations > LEAST_ROTATIONS * damping_times(scene)
    for name in FORMS:
        form = find_form(name)
        with suppress(FormNotValidError):
            form.problem(scene)
            if fast or not averages(form):
                accepted.append(name)
    return accepted


def methods_for(
    known: Pilot, tolerance: float, angles: bool, steady: bool
) -> Iterator[tuple[str, list[str]]]:
    """Forms worth measuring, those of angles if asked, with their solvers; over long runs steady ones only if asked."""
    rotations, row = known.rotations, (round(-log10(tolerance)) - 3) // len(LADDER[0])
    solvers = solvers_for(known.scene, row)
    quick = [
        name for name in solvers if not (find_solver(name).implicit or find_solver(name).low_order)
    ]
    longest = [
        name for name in quick if find_solver(name).many_periods or (steady and name in STEADY)
    ]
    for name in forms_for(known.scene, rotations):
        form = find_form(name)
        if isinstance(form, InPieces):
            windows = sum(
                known.share_of(each) for each in planned(form, known, tolerance) if each.tolerance
            )
            if windows * rotations < MOST_QUICK:
                yield name, solvers if windows * rotations < EVERY_LONG else quick
        elif angles or not form.angles:
            every = form.averaged or rotations < EVERY_LONG
            yield name, solvers if every else quick if rotations < MOST_QUICK else longest


def lacking(base: Laws, form: str, solver: str) -> bool:
    """Whether laws know nothing of a method, or what was true once."""
    law = base.methods.get((form, solver))
    return law is None or law.stale


def studies(question: Question, index: int, stratum: Stratum = "short") -> Iterator[Study]:
    """What is measured of one training scene, a form at a time."""
    scene, random = (
        question.scene,
        np.random.default_rng((TRAINING_SEED, index, 1 + STRATA.index(stratum))),
    )
    known = pilot(scene)
    rotations = known.rotations
    for row, choices in enumerate(LADDER):
        tolerance = float(random.choice(choices))
        angles = stratum == "short" and index % ANGLES_EVERY == 0 and row in ANGLES_ROWS
        for name, solvers in methods_for(
            known, tolerance, angles, row in STEADY_ROWS and rotations < MOST_FULL
        ):
            stiff = known.stiff and not find_form(name).averaged
            kept = stiff or (index + row) % IMPLICIT_EVERY == 0
            chosen = [each for each in solvers if kept or not find_solver(each).implicit]
            yield study(question, name, chosen, (tolerance,), rotations)
    if stratum == "long":
        return
    every = index % ASIDE_EVERY == 0 and rotations < ASIDE_ROTATIONS
    averaged = index % ASIDE_AVERAGED_EVERY == 0
    plain = [name for name in forms_for(scene, rotations) if not find_form(name).angles]
    stiff = damping_times(scene) > MOST_EXPLICIT / 10
    aside = [
        name
        for name in SOLVERS
        if name not in fast_solvers() and not (stiff and not find_solver(name).implicit)
    ]
    tolerances = tuple(float(random.choice(choices)) for choices in LADDER[:2])
    for name in plain:
        if every or (averaged and find_form(name).averaged):
            yield study(question, name, aside, tolerances, rotations)


def study(
    question: Question,
    form: str,
    solvers: list[str],
    tolerances: tuple[float, ...],
    rotations: float,
) -> Study:
    """One scene by a form, some solvers and tolerances."""
    return Study(
        name=question.name,
        title=question.name,
        scenes=((question.name, question.scene),),
        forms=(form,),
        solvers=tuple(solvers),
        tolerances=tolerances,
        samples=question.samples,
        max_seconds=min(MOST_SECONDS, SECONDS + SECONDS_PER_ROTATION * round(rotations, -3)),
        reference_seconds=REFERENCE_SECONDS,
        counted=False,
    )


def training(count: int = TRAINING_SCENES, base: Laws | None = None) -> list[list[Case]]:
    """All that is measured of the training scenes, or what laws lack of it, and of half as many long ones."""
    batches: list[list[Case]] = []
    for stratum, scenes in zip(STRATA, (count, count // LONG_SHARE), strict=True):
        for index, question in enumerate(questions(TRAINING_SEED, scenes, stratum)):
            for each in studies(question, index, stratum):
                known = base if stratum == "short" else None
                solvers = (
                    name
                    for name in each.solvers
                    if known is None or lacking(known, each.forms[0], name)
                )
                batches += replace(each, solvers=tuple(solvers)).batches()
    return batches


def without(store: Store, base: Laws | None, names: Collection[str]) -> Laws | None:
    """Laws that lack all methods of some forms and solvers, which have changed; the store forgets their cases."""
    store.drop([row["key"] for row in store if row["form"] in names or row["solver"] in names])
    return base and replace(
        base, methods={name: law for name, law in base.methods.items() if not {*name} & {*names}}
    )


def train(
    store: Store, count: int = TRAINING_SCENES, quiet: bool = False, base: Laws | None = None
) -> list[Record]:
    """Records of the training scenes, measured into a store where it does not hold them."""
    return Runner(store, quiet).run_batches("training", training(count, base))
