"""False successes: thousands of runs that claim success, each with its true error, before and after doubt.

In the folder `tests`, `python -m torture.successes --runs 5000` goes on where it stopped, and
writes its counts into docs/false-successes.md.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from polhode import solve
from polhode.harness.answers.doubt import OFF, OFF_SHARE
from polhode.harness.answers.questions import questions
from polhode.harness.common.text import percent
from polhode.harness.references.rotations import rotations as count_rotations
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import Form
from polhode.models.scene import BodyStart, Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import SolverNotValidError, Status
from polhode.solvers.solve import solve as run

SEED = 20
# Questions that are drawn, of which only the first ones are asked: far more than fill any number of runs.
MOST_QUESTIONS = 100_000
# Every third scene, if it has inertia and is given by an angular velocity, spins so many times faster; its run
# is as much shorter. An estimate.
FAST = 10.0
# Rotations of a scene, and of one that solvers with Python in the loop run. Estimates: beyond, thousands of
# runs take too long.
MOST_ROTATIONS = 1000.0
MOST_IN_PYTHON = 2.0
# Solvers and tolerances of two unrelated runs, about as sharp as double precision allows. Where they differ
# by KNOWN or more, over I_max, there is no truth to compare with: a tenth of the error that makes a success
# a false one, `doubt.OFF`.
TRUTH = (("taylor", 1e-16), ("cyrk-vern8", 1e-13))
KNOWN = 0.01
# Seconds after which such a run is given up, by estimate; then its scene is left out.
TRUTH_SECONDS = 20.0
# Words in the message of a run that a check has doubted, by the check.
CHECKS = {
    "the run's own error estimate": "L or E is off by",
    "least steps": "steps, expected at least",
    "an invariant": "the invariant is broken",
    "missing rows": "the library stopped at",
}


def scenes() -> Iterator[tuple[Scene, int, float]]:
    """Random scenes of `MOST_ROTATIONS` at most, each with its number of samples and of rotations."""
    for i, question in enumerate(questions(SEED, MOST_QUESTIONS)):
        scene = question.scene
        if i % 3 == 0 and isinstance(scene.start, BodyStart) and scene.stokes > 0:
            x, y, z = scene.start.angular_velocity
            start = replace(scene.start, angular_velocity=(FAST * x, FAST * y, FAST * z))
            scene = replace(scene, start=start, time=scene.time / FAST)
        try:
            rotations = count_rotations(scene)
        except ValueError:
            continue
        if rotations <= MOST_ROTATIONS:
            yield scene, question.samples, rotations


def truth(scene: Scene, form: Form, samples: int) -> tuple[np.ndarray, float] | None:
    """L and E over I_max, shape (samples, 4), and how well they are known; None if one of the runs fails."""
    problem = form.problem(scene)
    times = np.linspace(0.0, problem.end, samples)
    sharp_slow = []
    for method, tolerance in TRUTH:
        sharp = run(problem, method, tolerance, times, max_seconds=TRUTH_SECONDS)
        if not sharp.success:
            return None
        sharp_slow.append(form.observe(scene, sharp.states).slow / max(scene.ellipsoid.inertia))
    first, second = sharp_slow
    return first, float(np.max(np.abs(first - second)))


def runs(scene: Scene, samples: int, rotations: float, index: int) -> Iterator[dict[str, Any]]:
    """A row for each run of a scene by every form and solver at up to three tolerances: what became of it."""
    random = np.random.default_rng((SEED, index))
    full = truth(scene, find_form("jeffery" if scene.stokes == 0 else "quaternion"), samples)
    if full is None:
        return
    full_slow, uncertainty = full
    for name in FORMS:
        if not find_form(name).takes(scene):
            continue
        problem = find_form(name).problem(scene)
        for method in SOLVERS:
            solver = find_solver(method)
            if solver.closed_form or (
                "compiled" not in solver.backends and rotations > MOST_IN_PYTHON
            ):
                continue
            loose = 1e-4
            middle = 10.0 ** -random.integers(5, 8)
            tight = 10.0 ** -random.integers(8, 11)
            for tolerance in (loose, middle, tight):
                # Such a solver would take too many steps.
                if solver.low_order and tolerance == tight:
                    continue
                try:
                    solver.check(problem)
                    solution = solve(
                        scene, form=name, solver=method, tolerance=tolerance, samples=samples
                    )
                except SolverNotValidError:
                    break
                whole = len(solution.observables.energy) == samples
                # Doubt makes a claimed success a false one.
                claimed = whole and solution.status in (Status.REACHED_END, Status.FALSE_SUCCESS)
                slow = solution.observables.slow / max(scene.ellipsoid.inertia)
                yield {
                    "scene": index,
                    "form": name,
                    "solver": method,
                    "tolerance": tolerance,
                    "claimed": claimed,
                    "status": str(solution.status),
                    "message": solution.message,
                    "steps": solution.work.steps,
                    "error": float(np.max(np.abs(slow - full_slow))) if claimed else None,
                    "known": uncertainty,
                    "largest": float(np.max(np.abs(full_slow))),
                    "stated": solution.error.slow.high if solution.error.slow else None,
                }


def counted(rows: list[dict[str, Any]]) -> tuple[str, int]:
    """The page, and the number of complaints: false successes that nothing tells, and good runs that are doubted."""
    claimed = [row for row in rows if row["claimed"]]
    known = [row for row in claimed if row["known"] < KNOWN]
    off = [row for row in known if row["error"] > max(OFF, OFF_SHARE * row["largest"])]
    left = [row for row in off if row["status"] == Status.REACHED_END]
    unstated = [row for row in left if row["stated"] is None or row["stated"] < OFF]
    good = [row for row in known if row["error"] <= OFF and row["status"] == Status.FALSE_SUCCESS]
    by_solver = Counter(row["solver"] for row in off).most_common()
    solvers = ", ".join(f"{name} {count}" for name, count in by_solver)
    bounds = [row for row in known if row["stated"] is not None]
    above = sum(row["error"] > row["stated"] for row in bounds)
    caught = Counter(
        next(check for check, words in CHECKS.items() if words in row["message"])
        for row in off
        if row not in left
    )
    caught_words = ", ".join(f"{count} by {check}" for check, count in caught.most_common())
    # If none of n independent runs is false, their share is below 3/n at 95 %: (1 - 3/n)^n = exp(-3) = 0.05.
    unsaid, below = (percent(count / max(1, len(known)), ".2%") for count in (len(unstated), 3))
    exceeded = percent(above / max(1, len(bounds)), ".1%")
    lines = [
        "# False successes",
        "",
        f"- Still called a success: {len(left)}, {len(unstated)} of them without a stated error that says so: "
        f"{unsaid} of the runs that claim success"
        + (f" (below {below} at 95 %, were all runs independent)." if not unstated else "."),
        f"- Runs: {len(rows)}, of which {len(claimed)} claimed success; the truth is known for {len(known)} of these.",
        f"- Off by more than {OFF:g} of I_max and {percent(OFF_SHARE)} of the largest L or E: {len(off)} before doubt "
        f"({solvers}).",
        f"- Caught: {caught_words or 'none'}.",
        f"- An error is stated for {len(bounds)} runs; it is exceeded in {exceeded}.",
        f"- Good runs (error up to {OFF:g}) doubted: {len(good)}.",
        "",
        "Made by `python -m torture.successes` in the folder `tests`: random scenes, every third ten times as fast,",
        "by every form and solver at tolerance 1e-4, one of 1e-5 to 1e-7, and one of 1e-8 to 1e-10. The truth is known",
        f"by two unrelated sharp runs that agree to {KNOWN:g}. An averaged form's error includes that of averaging.",
    ]
    return "\n".join(lines) + "\n", len(unstated) + len(good)


def main() -> None:
    """Run what is not there yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5000)
    parser.add_argument("--kept", type=Path, default=Path("false-successes.partial"))
    parser.add_argument(
        "--page", type=Path, default=Path(__file__).parents[2] / "docs" / "false-successes.md"
    )
    given = parser.parse_args()
    given.kept.touch()
    rows = [json.loads(line) for line in given.kept.read_text(encoding="utf-8").splitlines()]
    done = max((row["scene"] for row in rows), default=-1)
    for index, (scene, samples, rotations) in enumerate(scenes()):
        if len(rows) >= given.runs:
            break
        if index > done:
            new = list(runs(scene, samples, rotations, index))
            rows += new
            with given.kept.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(row) + "\n" for row in new)
            print(f"scene {index}: {rotations:.0f} rotations, {len(rows)} runs", flush=True)
    page, complaints = counted(rows)
    given.page.write_text(page, encoding="utf-8")
    print(given.page)
    sys.exit(complaints > 0)


if __name__ == "__main__":
    main()
