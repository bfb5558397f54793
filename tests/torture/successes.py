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
# Every third scene spins so many times faster; its run is as much shorter.
FAST = 10.0
# Solvers with Python in the loop take too long beyond.
MOST_ROTATIONS, MOST_IN_PYTHON = 1000.0, 2.0
# Two unrelated runs as sharp as double precision allows; where they differ by more, there is no
# truth to compare with.
TRUTH, KNOWN = (("taylor", 1e-16), ("cyrk-vern8", 1e-13)), 0.01
# What a check says, by its name.
CHECKS = {
    "the run's own error estimate": "L or E is off by",
    "least steps": "steps, expected at least",
    "an invariant": "the invariant is broken",
    "missing rows": "the library stopped at",
}


def scenes() -> Iterator[tuple[Scene, int, float]]:
    """Random scenes, numbers of samples and of rotations."""
    for i, question in enumerate(questions(SEED, 100_000)):
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
    """Slow variables over I_max, and how well they are known."""
    problem = form.problem(scene)
    times, found = np.linspace(0.0, problem.end, samples), []
    for method, tolerance in TRUTH:
        sharp = run(problem, method, tolerance, times, max_seconds=20.0)
        if not sharp.success:
            return None
        found.append(form.observe(scene, sharp.states).slow / max(scene.ellipsoid.inertia))
    return found[0], float(np.max(np.abs(found[0] - found[1])))


def runs(scene: Scene, samples: int, rotations: float, index: int) -> Iterator[dict[str, Any]]:
    """What became of a scene by every form and solver at three tolerances."""
    random = np.random.default_rng((SEED, index))
    full = truth(scene, find_form("jeffery" if scene.stokes == 0 else "quaternion"), samples)
    if full is None:
        return
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
            for row, tolerance in enumerate(
                (1e-4, 10.0 ** -random.integers(5, 8), 10.0 ** -random.integers(8, 11))
            ):
                if solver.low_order and row == 2:
                    continue
                try:
                    solver.check(problem)
                    found = solve(
                        scene, form=name, solver=method, tolerance=tolerance, samples=samples
                    )
                except SolverNotValidError:
                    break
                whole = len(found.observables.energy) == samples
                claimed = whole and found.status in (Status.REACHED_END, Status.FALSE_SUCCESS)
                slow = found.observables.slow / max(scene.ellipsoid.inertia)
                yield {
                    "scene": index,
                    "form": name,
                    "solver": method,
                    "tolerance": tolerance,
                    "claimed": claimed,
                    "status": str(found.status),
                    "message": found.message,
                    "steps": found.work.steps,
                    "error": float(np.max(np.abs(slow - full[0]))) if claimed else None,
                    "known": full[1],
                    "largest": float(np.max(np.abs(full[0]))),
                    "stated": found.error.slow.high if found.error.slow else None,
                }


def counted(rows: list[dict[str, Any]]) -> tuple[str, int]:
    """The page, and how many false successes nothing says, or good runs are doubted."""
    claimed = [row for row in rows if row["claimed"]]
    known = [row for row in claimed if row["known"] < KNOWN]
    off = [row for row in known if row["error"] > max(OFF, OFF_SHARE * row["largest"])]
    left = [row for row in off if row["status"] == Status.REACHED_END]
    unstated = [row for row in left if row["stated"] is None or row["stated"] < OFF]
    good = [row for row in known if row["error"] <= OFF and row["status"] == Status.FALSE_SUCCESS]
    by = ", ".join(
        f"{name} {count}" for name, count in Counter(row["solver"] for row in off).most_common()
    )
    bounds = [row for row in known if row["stated"] is not None]
    above = sum(row["error"] > row["stated"] for row in bounds)
    caught = Counter(
        next(by for by, words in CHECKS.items() if words in row["message"])
        for row in off
        if row not in left
    )
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
        f"({by}).",
        f"- Caught: {', '.join(f'{count} by {by}' for by, count in caught.most_common()) or 'none'}.",
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
