"""What ensembles cost, measured: ``python -m polhode.harness.ensemble_bench [FOLDER]``, on a machine that is quiet.

Throughput per core is measured in one process at a time; two processes are compared with one as wall time, at the end.
"""

import json
import resource
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from polhode.harness.engines import Outcome, Processes, Serial
from polhode.harness.ensemble import Ensemble, Task, run_task
from polhode.harness.ensemble_batch import run_batches
from polhode.harness.ensemble_starts import Starts
from polhode.harness.ensemble_vector import run_vectorised
from polhode.harness.machine import machine, versions
from polhode.harness.partial_file import PartialFile
from polhode.harness.text import markdown, scientific
from polhode.harness.timing import collector_off, sentinel
from polhode.harness.worker import Worker
from polhode.models.catalogue import form as find_form
from polhode.models.problem import Problem
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.taylor import taylor_integrator

STOKES, SLOW_TIME, TOLERANCE, AVERAGED_TOLERANCE = 1e3, 0.2, 1e-9, 1e-6
SHAPES = {"1 : 0.8 : 0.5": Ellipsoid((1.0, 0.8, 0.5)), "1 : 1 : 2": Ellipsoid((1.0, 1.0, 2.0))}
STARTS = Starts("momentum-isotropic", (0.0, 0.0, 0.7))
ROUNDS = 7
# Seconds of a task whose engine overhead is measured, and how many of them.
TASK_SECONDS, TASKS = 1.0, 10
LIMIT = 3600.0
# Sweeps whose cost is laid out: equations, particles, St; the first two are 10⁹ particle·St.
PLANS = (
    ("full", 1_000_000, 1e3),
    ("full", 10_000, 1e5),
    ("full", 1_000_000_000, 1e3),
    ("averaged", 1_000_000_000, 1e3),
)
BLOCK = 100_000

Row = dict[str, Any]


def main(folder: Path) -> None:
    """Measure everything and write ``throughput.json`` and ``README.md`` into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    steady = sentinel()
    found = {
        "full": [full_throughput(name, shape) for name, shape in SHAPES.items()],
        "averaged": [averaged_throughput(name, shape) for name, shape in SHAPES.items()],
        "tasks": [task_throughput(equations) for equations in ("full", "averaged")],
        "memory": memory(),
        "overhead": overhead(),
        "two_processes": two_processes(),
        "machine": machine(),
        "versions": versions(),
        "sentinel_seconds": [steady, sentinel()],
    }
    for name, text in (("throughput.json", json.dumps(found, indent=1) + "\n"), ("README.md", page(found))):
        with PartialFile(folder / name) as file:
            file.write(text)


def full_throughput(name: str, shape: Ellipsoid, particles: int = 512) -> Row:
    """Particles per second in SIMD lanes and one by one, by one method at one tolerance, and both errors."""
    problem, starts = _problem(shape, "full", particles)
    times = np.array([0.0, problem.end])
    scalar = taylor_integrator(problem.field, problem.dimension, len(problem.parameters or ()), TOLERANCE)

    def one_by_one() -> np.ndarray:
        ends = np.empty_like(starts)
        scalar.pars[:] = problem.parameters
        for end, start in zip(ends, starts, strict=True):
            scalar.time = 0.0
            scalar.state[:] = start
            scalar.propagate_grid(times)
            end[:] = scalar.state
        return ends

    def in_lanes() -> np.ndarray:
        return run_batches(problem, starts, times, TOLERANCE)[0][-1]

    exact = run_batches(problem, starts, times, 1e-15)[0][-1]
    (slow, alone), (fast, together) = _alternate(one_by_one, in_lanes)
    return {
        "shape": name,
        "scalar_per_second": particles / slow,
        "lanes_per_second": particles / fast,
        "speedup": slow / fast,
        "scalar_error": float(np.max(np.abs(alone - exact))),
        "lanes_error": float(np.max(np.abs(together - exact))),
    }


def averaged_throughput(name: str, shape: Ellipsoid, particles: int = 50_000) -> Row:
    """Particles per second of the averaged equations, end alone, with the error's median and 99th percentile."""
    problem, starts = _problem(shape, "averaged", particles)
    times = np.array([0.0, problem.end])
    ((seconds, states),) = _alternate(lambda: run_vectorised(problem, starts, times, AVERAGED_TOLERANCE)[0][-1])
    some = slice(0, 2000)
    exact = run_vectorised(problem, starts[some], times, 1e-11)[0][-1]
    error = np.max(np.abs(states[some] - exact), axis=1)
    return {
        "shape": name,
        "per_second": particles / seconds,
        "median_error": float(np.median(error)),
        "error_of_99_percent": float(np.quantile(error, 0.99)),
    }


def task_throughput(equations: Any) -> Row:
    """Particles per second of whole tasks, statistics at 101 samples and 11 snapshots included; bytes of a record."""
    ensemble = _ensemble(SHAPES["1 : 0.8 : 0.5"], equations, 2000 if equations == "full" else 20_000)
    ((seconds, record),) = _alternate(lambda: run_task(Task(ensemble, 0)))
    return {
        "equations": equations,
        "per_second": ensemble.particles / seconds,
        "record_bytes": len(json.dumps(record)),
    }


def memory(particles: int = 100_000) -> Row:
    """Largest memory of a process that runs 10⁵ particles of the full equations, in ten tasks."""
    ensemble = replace(_ensemble(SHAPES["1 : 0.8 : 0.5"], "full", particles), block=particles // 10)
    with Worker() as worker:
        reply = worker.run(_run_all, ensemble, limit=LIMIT)
    return {"particles": particles, "bytes": reply.value, "seconds": reply.seconds, "failure": reply.message or None}


def _run_all(ensemble: Ensemble) -> int:
    for task in ensemble.tasks():
        run_task(task)
    kibibyte = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * kibibyte


def overhead() -> list[Row]:
    """What engines add to tasks of a second that use the processor, the start of processes left out."""
    rows = []
    for name, engine in (("serial", Serial()), ("one process", Processes(1))):
        arrivals = [perf_counter() for _ in engine.run(_busy, range(TASKS + 1))]
        seconds = (arrivals[-1] - arrivals[0]) / TASKS
        rows.append({"engine": name, "task_seconds": TASK_SECONDS, "share": seconds / TASK_SECONDS - 1})
    return rows


def _busy(_: int) -> None:
    end = perf_counter() + TASK_SECONDS
    while perf_counter() < end:
        pass


def two_processes(particles: int = 40_000) -> Row:
    """Wall time of the same tasks by one process and by two, both warm: from the first task's end on."""
    ensemble = replace(_ensemble(SHAPES["1 : 0.8 : 0.5"], "full", particles), block=2000)
    seconds = {workers: _warm_seconds(Processes(workers), ensemble) for workers in (1, 2)}
    return {
        "particles": particles,
        "one_seconds": seconds[1],
        "two_seconds": seconds[2],
        "ratio": seconds[1] / seconds[2],
    }


def _warm_seconds(engine: Processes, ensemble: Ensemble) -> float:
    """Seconds per task times the number of tasks, measured after each process has compiled."""
    tasks = list(ensemble.tasks())
    warm = [Task(replace(ensemble, seed=ensemble.seed + 1 + index), 0) for index in range(2 * engine.workers)]
    ends = [perf_counter() for outcome in engine.run(run_task, [*warm, *tasks]) if _good(outcome)]
    done = ends[len(warm) - 1 :]
    return (done[-1] - done[0]) / (len(done) - 1) * len(tasks)


def _good(outcome: Outcome) -> bool:
    if outcome.message:
        raise RuntimeError(outcome.message)
    return True


def _ensemble(shape: Ellipsoid, equations: Any, particles: int) -> Ensemble:
    tolerance = TOLERANCE if equations == "full" else AVERAGED_TOLERANCE
    return Ensemble(
        shape,
        STOKES,
        SLOW_TIME * STOKES,
        STARTS,
        particles=particles,
        block=particles,
        equations=equations,
        tolerance=tolerance,
    )


def _problem(shape: Ellipsoid, equations: Any, particles: int) -> tuple[Problem, np.ndarray]:
    form = _ensemble(shape, equations, 1).form
    drawn = STARTS.draw(shape, np.random.SeedSequence(1), particles)
    q0, q1, q2, q3 = drawn.quaternion[0].tolist()
    w1, w2, w3 = drawn.angular_velocity[0].tolist()
    scene = Scene(shape, STOKES, BodyStart((q0, q1, q2, q3), (w1, w2, w3)), SLOW_TIME * STOKES)
    return find_form(form).problem(scene), drawn.states(form, shape)


def _alternate(*functions: Callable[[], Any]) -> list[tuple[float, Any]]:
    """Least processor time of each of several functions in turns, after a first run of each, and what it returned."""
    results = [function() for function in functions]
    best = [np.inf] * len(functions)
    with collector_off():
        for _ in range(ROUNDS):
            for k, function in enumerate(functions):
                began = process_time()
                function()
                best[k] = min(best[k], process_time() - began)
    return list(zip(best, results, strict=True))


def plan(tasks: list[Row]) -> list[tuple[str, ...]]:
    """Tasks, bytes in the store and core hours of large sweeps, in blocks of `BLOCK`, from measured whole tasks."""
    rows = []
    for equations, particles, stokes in PLANS:
        row = next(row for row in tasks if row["equations"] == equations)
        # The number of rotations, and with it the cost of full equations, grows in proportion to St.
        rate = row["per_second"] * (STOKES / stokes if equations == "full" else 1.0)
        count = -(-particles // BLOCK)
        rows.append(
            (
                equations,
                f"{particles:,}",
                f"{stokes:g}",
                f"{count:,}",
                f"{count * row['record_bytes'] / 2**20:,.1f} MiB",
                f"{particles / rate / 3600:,.2f}",
            )
        )
    return rows


def page(found: dict[str, Any]) -> str:
    """The measured figures as a page."""
    full = [
        (
            row["shape"],
            f"{row['scalar_per_second']:,.0f}",
            f"{row['lanes_per_second']:,.0f}",
            f"{row['speedup']:.2f}",
            scientific(row["scalar_error"]),
            scientific(row["lanes_error"]),
        )
        for row in found["full"]
    ]
    averaged = [
        (
            row["shape"],
            f"{row['per_second']:,.0f}",
            scientific(row["median_error"]),
            scientific(row["error_of_99_percent"]),
        )
        for row in found["averaged"]
    ]
    tasks = [(row["equations"], f"{row['per_second']:,.0f}", f"{row['record_bytes']:,}") for row in found["tasks"]]
    engines = [(row["engine"], f"{100 * row['share']:.2f} %") for row in found["overhead"]]
    two, used = found["two_processes"], found["memory"]
    return "\n".join(
        [
            "# What ensembles cost\n",
            f"St = {STOKES:g}, t₂ = {SLOW_TIME:g}, isotropic starts of |L| = 0.7 I_max, on "
            f"{found['machine']['processor']}. Made by `python -m polhode.harness.ensemble_bench`; "
            "the numbers are in [throughput.json](throughput.json). Processor time, the least of "
            f"{ROUNDS} runs in turns, one process at a time.\n",
            f"## Full equations, Taylor at tolerance {TOLERANCE:g}, particles per second and core\n",
            markdown(
                ("shape", "one by one", "in lanes", "ratio", "error", "error in lanes"), full, right=(1, 2, 3, 4, 5)
            ),
            f"## Averaged equations at tolerance {AVERAGED_TOLERANCE:g}, particles per second and core\n",
            markdown(("shape", "end alone", "median error", "error of 99 %"), averaged, right=(1, 2, 3)),
            "## Whole tasks, statistics at 101 samples and 11 snapshots included\n",
            markdown(("equations", "particles per second and core", "bytes of a record"), tasks, right=(1, 2)),
            f"## What large sweeps to t₂ = {SLOW_TIME:g} take, in tasks of up to {BLOCK:,} particles\n",
            markdown(
                ("equations", "particles", "St", "tasks", "store", "core hours"),
                plan(found["tasks"]),
                right=(1, 2, 3, 4, 5),
            ),
            f"## What an engine adds to tasks of {TASK_SECONDS:g} s\n",
            markdown(("engine", "overhead"), engines, right=(1,)),
            "## Memory and processes\n",
            f"- {used['particles']:,} particles of the full equations: at most "
            f"{(used['bytes'] or 0) / 2**20:.0f} MiB in the process that runs them, {used['seconds']:.1f} s.",
            f"- Two processes against one on {found['machine']['cores']} cores, {two['particles']:,} particles: "
            f"{two['ratio']:.2f} times as fast ({two['one_seconds']:.1f} s and {two['two_seconds']:.1f} s).\n",
        ]
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("reports/sweep"))
