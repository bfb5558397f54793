"""What ensembles cost, measured on a quiet machine (`polhode throughput`).

Throughput per core is measured in one process at a time; two processes are compared with one as wall time, at the end.
"""

import json
import resource
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter, process_time
from typing import Any

import numpy as np

from polhode.harness.common.machine import machine, versions
from polhode.harness.common.timing import Patience, collector_off, sentinel
from polhode.harness.common.worker import Worker
from polhode.harness.ensembles.engines import processes, serial
from polhode.harness.ensembles.ensemble import Ensemble, Task, run_task
from polhode.harness.ensembles.starts import Starts
from polhode.models.catalogue import form as find_form
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.ensembles.runge_kutta_batch import array_field, integrate, run_vectorised
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.taylor import taylor_integrator

STOKES, SLOW_TIME, TOLERANCE, AVERAGED_TOLERANCE = 1e3, 0.2, 1e-9, 1e-6
SHAPES = {"1 : 0.8 : 0.5": Ellipsoid((1.0, 0.8, 0.5)), "1 : 1 : 2": Ellipsoid((1.0, 1.0, 2.0))}
STARTS = Starts("momentum-isotropic", (0.0, 0.0, 0.7))
ROUNDS = 21
# Seconds of a task whose engine overhead is measured, and how many of them.
TASK_SECONDS, TASKS = 1.0, 10
LIMIT = 3600.0


def measure() -> dict[str, Any]:
    """Everything that `polhode.harness.pages.ensembles` shows."""
    steady = sentinel()
    return {
        "settings": {
            "stokes": STOKES,
            "slow_time": SLOW_TIME,
            "tolerance": TOLERANCE,
            "averaged_tolerance": AVERAGED_TOLERANCE,
            "rounds": ROUNDS,
            "task_seconds": TASK_SECONDS,
        },
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


def full_throughput(name: str, shape: Ellipsoid, particles: int = 2048) -> dict[str, Any]:
    """Particles per second in SIMD lanes and one by one, by one method at one tolerance, and both errors."""
    scene, problem, starts = _problem(shape, "full", particles)
    slow_starts = find_form(problem.name).observe(scene, starts).slow
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
        return run_batches(problem, starts, times, TOLERANCE, slow_starts)[0][-1]

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


def averaged_throughput(name: str, shape: Ellipsoid, particles: int = 20_000) -> dict[str, Any]:
    """Particles per second of the averaged equations by how much is kept of them, and what bounds them.

    With the end alone, with 101 samples, and in whole tasks, statistics included; the share of the first that the
    field takes, and how often it is asked; the error's median and 99th percentile.
    """
    _, problem, starts = _problem(shape, "averaged", particles)
    two, samples = np.array([0.0, problem.end]), np.linspace(0.0, problem.end, 101)
    field = array_field(problem)
    asked: list[tuple[int, float]] = []
    spent: list[float] = []

    def timed_field(y: np.ndarray, rates: np.ndarray) -> None:
        began = process_time()
        field(y, rates)
        asked.append((y.shape[1], process_time() - began))

    def field_alone() -> None:
        asked.clear()
        integrate(timed_field, starts, two, AVERAGED_TOLERANCE)
        spent.append(sum(seconds for _, seconds in asked))

    ensemble = _ensemble(shape, "averaged", particles)
    (end, result), _, (sampled, _), (task, _) = _alternate(
        lambda: run_vectorised(problem, starts, two, AVERAGED_TOLERANCE)[0][-1],
        field_alone,
        lambda: [run_vectorised(problem, part, samples, AVERAGED_TOLERANCE) for part in np.array_split(starts, 5)],
        lambda: run_task(Task(ensemble, 0)),
    )
    some = slice(0, 2000)
    exact = run_vectorised(problem, starts[some], two, 1e-11)[0][-1]
    error = np.max(np.abs(result[some] - exact), axis=1)
    return {
        "shape": name,
        "per_second": particles / end,
        "sampled_per_second": particles / sampled,
        "task_per_second": particles / task,
        "evaluations_per_particle": sum(width for width, _ in asked) / particles,
        "field_share": min(spent) / end,
        "median_error": float(np.median(error)),
        "error_of_99_percent": float(np.quantile(error, 0.99)),
    }


def task_throughput(equations: Any) -> dict[str, Any]:
    """Particles per second of whole tasks, statistics at 101 samples and 11 snapshots included; bytes of a record."""
    ensemble = _ensemble(SHAPES["1 : 0.8 : 0.5"], equations, 2000 if equations == "full" else 20_000)
    ((seconds, record),) = _alternate(lambda: run_task(Task(ensemble, 0)))
    speed = ensemble.particles / seconds
    return {"equations": equations, "per_second": speed, "record_bytes": len(json.dumps(record))}


def memory(particles: int = 100_000) -> dict[str, Any]:
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


def overhead() -> list[dict[str, Any]]:
    """What engines add to tasks of a second that use the processor, the start of processes left out."""
    rows = []
    for name, engine in (("serial", serial), ("one process", partial(processes, 1))):
        arrivals = [perf_counter() for _ in engine(_busy, range(TASKS + 1))]
        seconds = (arrivals[-1] - arrivals[0]) / TASKS
        rows.append({"engine": name, "task_seconds": TASK_SECONDS, "share": seconds / TASK_SECONDS - 1})
    return rows


def _busy(_: int) -> None:
    end = perf_counter() + TASK_SECONDS
    while perf_counter() < end:
        pass


def two_processes(particles: int = 40_000) -> dict[str, Any]:
    """Wall time of the same tasks by one process and by two, both warm: from the first task's end on."""
    ensemble = replace(_ensemble(SHAPES["1 : 0.8 : 0.5"], "full", particles), block=2000)
    one, two = (_warm_seconds(workers, ensemble) for workers in (1, 2))
    return {"particles": particles, "one_seconds": one, "two_seconds": two, "ratio": one / two}


def _warm_seconds(workers: int, ensemble: Ensemble) -> float:
    """Seconds per task times the number of tasks, measured after each process has compiled."""
    tasks = list(ensemble.tasks())
    warm = [Task(replace(ensemble, seed=ensemble.seed + 1 + index), 0) for index in range(2 * workers)]
    ends = []
    for outcome in processes(workers, run_task, [*warm, *tasks]):
        if outcome.message:
            raise RuntimeError(outcome.message)
        ends.append(perf_counter())
    done = ends[len(warm) - 1 :]
    return (done[-1] - done[0]) / (len(done) - 1) * len(tasks)


def _ensemble(shape: Ellipsoid, equations: Any, particles: int) -> Ensemble:
    tolerance = TOLERANCE if equations == "full" else AVERAGED_TOLERANCE
    options: Any = {"particles": particles, "block": particles, "equations": equations, "tolerance": tolerance}
    return Ensemble(shape, STOKES, SLOW_TIME * STOKES, STARTS, **options)


def _problem(shape: Ellipsoid, equations: Any, particles: int) -> tuple[Scene, Problem, np.ndarray]:
    ensemble = _ensemble(shape, equations, 1)
    drawn = STARTS.draw(shape, np.random.SeedSequence(1), particles)
    scene = ensemble.first_scene(drawn)
    return scene, find_form(ensemble.form).problem(scene), drawn.states(ensemble.form, shape)


def _alternate(*functions: Callable[[], Any]) -> list[tuple[float, Any]]:
    """Least processor time of each of several functions in turns, after a first run of each, and what it returned."""
    results = [function() for function in functions]
    best = [np.inf] * len(functions)
    patience = Patience(sentinel, share=0.5)
    with collector_off():
        for _ in range(ROUNDS):
            for k, function in enumerate(functions):
                patience.steady()
                began = process_time()
                function()
                best[k] = min(best[k], process_time() - began)
    return list(zip(best, results, strict=True))
