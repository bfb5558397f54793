"""Cost of ensembles, measured on a quiet machine (`polhode throughput`).

Throughput per core is measured in one process at a time; two processes are compared with one as
wall time, at the end. The page is `reports/sweep/throughput.md`. "Lanes" are the slots of SIMD registers,
in which particles run side by side. The "sentinel" is a fixed piece of arithmetic that shows how fast
the machine is. A "turn" of several functions runs each of them once, one after the other. A "plan" is the
method and the step of equal steps, chosen on some particles.
"""

import json
import resource
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from time import perf_counter, process_time
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np

from polhode.harness.common.machine import here
from polhode.harness.common.progress import Steps
from polhode.harness.common.timing import Patience, collector_off, sentinel
from polhode.harness.common.worker import Worker
from polhode.harness.ensembles.engines import processes, serial
from polhode.harness.ensembles.ensemble import PLANNED_PARTICLES, Ensemble, Task, run_task
from polhode.harness.ensembles.hybrid import ERROR_OVER_TOLERANCE, run_full
from polhode.harness.ensembles.starts import Starts
from polhode.models.catalogue import form as find_form
from polhode.models.shape import Ellipsoid
from polhode.solvers.ensembles.equal_steps import MIN_SEGMENTS, Plan, plan, run
from polhode.solvers.ensembles.taylor_batch import run_batches
from polhode.solvers.solve import solve

# The file beside this module says what each setting is.
SETTINGS = SimpleNamespace(
    **tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
)
# Semi-axes by the words of the page: a triaxial ellipsoid and a prolate spheroid.
SHAPES = {"1 : 0.8 : 0.5": Ellipsoid((1.0, 0.8, 0.5)), "1 : 1 : 2": Ellipsoid((1.0, 1.0, 2.0))}
# Starts of all ensembles: |L| over I_max is 0.7, an example, in any direction.
_STARTS = Starts(motion="momentum-isotropic", angular_momentum=[0.0, 0.0, 0.7])
# Seconds that the process may take whose memory is measured. An estimate, far above the seconds that it takes.
_MEMORY_SECONDS = 3600.0
# Particles of each measurement. Estimates: enough to fill all lanes (16 particles at most) many times, and few
# enough that `polhode throughput` takes minutes.
_FULL_PARTICLES = 2048  # Of `full_throughput`.
_PARTICLES = 20_000  # Of long runs, and of whole ensembles.
_MEMORY_PARTICLES = 100_000
# Tasks into which the particles are divided whose memory is measured: it must not grow from task to task.
_MEMORY_TASKS = 10
_TWO_PROCESSES_PARTICLES = 400_000
# Particles of each of its tasks. An estimate: with 20 tasks two processes end at about the same time.
_TWO_PROCESSES_BLOCK = 20_000
# Tolerance of Taylor's method that gives a run to rounding.
_EXACT_TOLERANCE = 1e-15
# The first tolerance of Taylor's method that is tried, over the target. An estimate: as a tolerance is of a
# step, and errors of steps add up, a looser one will not do.
_LOOSEST_TAYLOR = 10
# Tolerances that are tried: each power of ten has eight parts, all of them make six powers of ten.
# Estimates: finer steps find a rate a few per cent higher.
_TOLERANCES_PER_DECADE = 8
_TOLERANCES = 48
# Long runs: times at which errors are looked at, and t₂ = t/St at the end, as in the scenes of `polhode bench`.
_LONG_SAMPLES = 51  # An estimate: errors are maxima over them.
_LONG_SLOW_TIME = 0.5
# The requested error of long runs over the one of the full equations, which stand for the exact ones. An estimate:
# errors are then known to 0.1 % of the requested one.
_LONG_ERROR_OVER_EXACT = 1000
# Parts of the particles whose samples are held one after another, as in a task. An estimate: a part has 4000
# particles, and a task holds some 3000 to 5000 at once (`ensemble._MAX_NUMBERS_HELD`).
_SAMPLED_PARTS = 5
# Share of the time that may be spent waiting for a steady machine (`polhode.harness.common.timing.Patience`).
# An estimate: a larger one waits longer on a busy machine.
_WAITING_SHARE = 0.5
# Share of the turns that reach the rate called "slower": the upper quartile of their times.
_MOST_TURNS = 0.75
# Share of the particles whose error a row bounds, beside the median.
_NEARLY_ALL = 0.99
# Seeds of phases that are drawn, of starts, and of starts that are only timed: any do.
_SEED = 1
_TIMED_SEED = 2
T = TypeVar("T")


def measure(quiet: bool = False) -> dict[str, Any]:
    """Everything that the page of throughput shows (`polhode.harness.pages.ensembles`)."""
    steady = sentinel()
    targets: list[tuple[str, float]] = [*product(SHAPES, SETTINGS.targets)]
    shape_equations = [*product(SHAPES, ("full", "averaged"))]
    # The other four: long runs, memory, overhead, two processes.
    progress = Steps("throughput", len(targets) + len(shape_equations) + 4, "measurements", quiet)

    def finished(title: str, measurement: Callable[[], T]) -> T:
        """Run a measurement under a title that is shown, and return its result."""
        progress.detail(title)
        result = measurement()
        progress.advance()
        return result

    with progress:
        full = []
        for name, target in targets:
            run_one = partial(full_throughput, name, SHAPES[name], target)
            full.append(finished(f"full, {name}", run_one))
        long = finished("long runs", lambda: list(long_runs()))
        tasks = []
        for name, equations in shape_equations:
            run_one = partial(ensemble_throughput, name, equations)
            tasks.append(finished(f"{equations}, {name}", run_one))
        measurements = {
            "full": full,
            "long": long,
            "tasks": tasks,
            "memory": finished("memory", memory),
            "overhead": finished("overhead", lambda: list(overhead())),
            "two_processes": finished("two processes", two_processes),
        }
    return {
        "settings": {
            **vars(SETTINGS),
            "judge": f"{SETTINGS.judge} at tolerance {SETTINGS.judge_tolerance:g}",
        },
        **measurements,
        **here(),
        "sentinel_seconds": [steady, sentinel()],
    }


def full_throughput(
    name: str, shape: Ellipsoid, target: float, particles: int = _FULL_PARTICLES
) -> dict[str, Any]:
    """Particles per second by Taylor's lanes and by equal steps, at most `target` off at the end in every particle.

    Taylor's method, which adapts its steps, has the keys that begin with "taylor"; equal steps have the
    others. Three turns in four reach the "slower" rates.
    """
    ensemble = _ensemble(shape, "full", particles)
    problem = ensemble.problem
    starts = _starts(ensemble, particles)
    times = np.array([0.0, problem.end])

    def taylor(tolerance: float) -> np.ndarray:
        return run_batches(problem, starts, times, tolerance)[0][-1]

    def equal_steps(tolerance: float, chosen: Plan) -> np.ndarray:
        return run(problem, starts, times, tolerance, chosen)[0][-1]

    # Ends of the particles to rounding, from which errors of the whole state are taken.
    exact = taylor(_EXACT_TOLERANCE)

    def errors(ends: np.ndarray) -> np.ndarray:
        return np.max(np.abs(ends - exact), axis=1)

    def choose(tolerance: float) -> tuple[Plan, float] | None:
        """A plan whose largest error is small enough, and the seconds that it took."""
        began = process_time()
        chosen = plan(problem, starts[:PLANNED_PARTICLES], times, tolerance)
        spent = process_time() - began
        if chosen and errors(equal_steps(tolerance, chosen)).max() <= target:
            return chosen, spent
        return None

    # The loosest tolerance of each method by which no particle errs by more than `target`.
    taylor_tolerance = next(
        candidate
        for candidate in _below(_LOOSEST_TAYLOR * target)
        if errors(taylor(candidate)).max() <= target
    )
    tolerance, (chosen, plan_seconds) = next(
        (candidate, planned) for candidate in _below(target) if (planned := choose(candidate))
    )
    # Processor times of the turns, and ends of the particles.
    (taylor_times, taylor_ends), (equal_times, equal_ends) = _alternate(
        lambda: taylor(taylor_tolerance), lambda: equal_steps(tolerance, chosen)
    )
    return {
        "shape": name,
        "target": target,
        "taylor_tolerance": taylor_tolerance,
        "taylor_per_second": particles / min(taylor_times),
        "taylor_slower_per_second": _of_most_turns(taylor_times, particles),
        "taylor_error": float(errors(taylor_ends).max()),
        "method": chosen.method,
        # A plan has the steps of a segment. A run from start to end has the least number of segments.
        "steps": chosen.steps * MIN_SEGMENTS,
        "per_second": particles / min(equal_times),
        "slower_per_second": _of_most_turns(equal_times, particles),
        "speedup": min(taylor_times) / min(equal_times),
        "error": float(errors(equal_ends).max()),
        "median_error": float(np.median(errors(equal_ends))),
        "plan_seconds": plan_seconds,
    }


def _below(largest: float) -> list[float]:
    """Tolerances from the largest one down, equally spaced in their logarithm."""
    return [largest * 10 ** (-k / _TOLERANCES_PER_DECADE) for k in range(_TOLERANCES)]


def long_runs(
    particles: int = _PARTICLES, known: int = SETTINGS.long_known
) -> Iterator[dict[str, Any]]:
    """Averaged and hybrid equations of long runs at large St: particles per second, and errors in L and E of some.

    `known` particles run by full equations too, which gives their errors.
    """
    shape = SHAPES["1 : 0.8 : 0.5"]
    samples = _LONG_SAMPLES
    random = np.random.default_rng(_SEED)
    hybrid = replace(
        _ensemble(shape, "hybrid", particles), tolerance=SETTINGS.long_error, samples=samples
    )
    hybrid = replace(
        hybrid, stokes=SETTINGS.long_stokes, time=_LONG_SLOW_TIME * SETTINGS.long_stokes
    )
    scene = hybrid.any_scene
    full = find_form(hybrid.form)
    times = np.linspace(0.0, scene.time, samples)
    full_error = SETTINGS.long_error / _LONG_ERROR_OVER_EXACT
    states, _ = run_full(scene, _starts(hybrid, known), times, full_error)
    exact = full.observe(scene, states.reshape(samples * known, -1)).slow.reshape(samples, known, 4)
    for ensemble in (
        replace(hybrid, equations="averaged", tolerance=hybrid.tolerance / ERROR_OVER_TOLERANCE),
        hybrid,
    ):
        form = find_form(ensemble.form)
        starts = _starts(ensemble, known)
        many = _starts(ensemble, particles, seed=_TIMED_SEED)
        times = np.linspace(0.0, ensemble.problem.end, samples)
        began = process_time()
        states, _ = ensemble.states(starts, times, random)
        spent = process_time() - began
        slow = form.observe(scene, states.reshape(samples * known, -1)).slow.reshape(
            samples, known, 4
        )
        ((seconds, _),) = _alternate(
            partial(ensemble.states, many, times[[0, -1]], random), rounds=SETTINGS.few_rounds
        )
        errors = np.abs(slow - exact).max(axis=(0, 2)) / max(shape.inertia)
        yield {
            "equations": ensemble.equations,
            "per_second": particles / min(seconds),
            "slower_per_second": _of_most_turns(seconds, particles),
            "within": float(np.mean(errors <= SETTINGS.long_error)),
            "median_error": float(np.median(errors)),
            "error": float(errors.max()),
            # Of the `known` particles, compilation and the choice of what is averaged included.
            "plan_seconds": spent,
        }


def ensemble_throughput(name: str, equations: Any, particles: int = _PARTICLES) -> dict[str, Any]:
    """Particles per second by how much is kept of them, the error of their ends, and the bytes of a task's record.

    The keys `end_…` are of the end alone, `sampled_…` of an ensemble's samples, the others of whole tasks, their
    statistics included.
    """
    ensemble = _ensemble(SHAPES[name], equations, particles)
    problem = ensemble.problem
    starts = _starts(ensemble, particles)
    two = np.array([0.0, problem.end])
    samples = np.linspace(0.0, problem.end, Ensemble.samples)
    random = np.random.default_rng(_SEED)
    (end, (states, _)), (sampled, _), (task, record) = _alternate(
        lambda: ensemble.states(starts, two, random),
        lambda: [
            ensemble.states(part, samples, random)
            for part in np.array_split(starts, _SAMPLED_PARTS)
        ],
        lambda: run_task(Task(ensemble, 0)),
        rounds=SETTINGS.few_rounds,
    )
    alone = (replace(problem, start=tuple(start)) for start in starts[: SETTINGS.known].tolist())
    ends = [
        solve(start_problem, SETTINGS.judge, SETTINGS.judge_tolerance, two).states[-1]
        for start_problem in alone
    ]
    error = np.max(np.abs(states[-1, : SETTINGS.known] - np.array(ends)), axis=1)
    return {
        "shape": name,
        "equations": equations,
        "end_per_second": particles / min(end),
        "end_slower_per_second": _of_most_turns(end, particles),
        "sampled_per_second": particles / min(sampled),
        "sampled_slower_per_second": _of_most_turns(sampled, particles),
        "per_second": particles / min(task),
        "slower_per_second": _of_most_turns(task, particles),
        "median_error": float(np.median(error)),
        "error_of_99_percent": float(np.quantile(error, _NEARLY_ALL)),
        "record_bytes": len(json.dumps(record)),
    }


def memory(particles: int = _MEMORY_PARTICLES) -> dict[str, Any]:
    """Largest memory, in bytes, of a process that runs particles of the full equations in `_MEMORY_TASKS` tasks."""
    ensemble = replace(
        _ensemble(SHAPES["1 : 0.8 : 0.5"], "full", particles), block=particles // _MEMORY_TASKS
    )
    with Worker() as worker:
        reply = worker.run(_run_all, ensemble, limit=_MEMORY_SECONDS)
    return {
        "particles": particles,
        "bytes": reply.value,
        "seconds": reply.seconds,
        "failure": reply.message or None,
    }


def _run_all(ensemble: Ensemble) -> int:
    """Largest memory, in bytes, of the process that has run all tasks of an ensemble."""
    for task in ensemble.tasks():
        run_task(task)
    # macOS counts bytes, other systems KiB.
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def overhead() -> Iterator[dict[str, Any]]:
    """Time that engines add to tasks of `task_seconds`, over that time, without the start of processes."""
    for name, engine in (("serial", serial), ("one process", partial(processes, 1))):
        # The time from the first task's end on: the first one starts the process.
        arrivals = [perf_counter() for _ in engine(_busy, range(SETTINGS.tasks + 1))]
        seconds = (arrivals[-1] - arrivals[0]) / SETTINGS.tasks
        yield {
            "engine": name,
            "task_seconds": SETTINGS.task_seconds,
            "share": seconds / SETTINGS.task_seconds - 1,
        }


def _busy(_: int) -> None:
    """A task that does nothing but take its time."""
    end = perf_counter() + SETTINGS.task_seconds
    while perf_counter() < end:
        pass


def two_processes(particles: int = _TWO_PROCESSES_PARTICLES) -> dict[str, Any]:
    """Wall time of the same tasks by one process and by two, both warm: from the first task's end on."""
    ensemble = _ensemble(SHAPES["1 : 0.8 : 0.5"], "full", particles)
    ensemble = replace(ensemble, block=_TWO_PROCESSES_BLOCK)
    one = _warm_seconds(1, ensemble)
    two = _warm_seconds(2, ensemble)
    return {"particles": particles, "one_seconds": one, "two_seconds": two, "ratio": one / two}


def _warm_seconds(workers: int, ensemble: Ensemble) -> float:
    """Seconds per task times the number of tasks, measured after each process has compiled."""
    tasks = list(ensemble.tasks())
    # Tasks of other seeds, two for each process, by which all of them compile. The time begins with the end of
    # the last one.
    warm = [
        Task(replace(ensemble, seed=ensemble.seed + 1 + index), 0) for index in range(2 * workers)
    ]
    ends = []
    for outcome in processes(workers, run_task, [*warm, *tasks]):
        if outcome.message:
            raise RuntimeError(outcome.message)
        ends.append(perf_counter())
    done = ends[len(warm) - 1 :]
    return (done[-1] - done[0]) / (len(done) - 1) * len(tasks)


def _ensemble(shape: Ellipsoid, equations: Any, particles: int) -> Ensemble:
    """An ensemble at the St, duration and tolerance of the settings, as a single task."""
    options: Any = {
        "particles": particles,
        "block": particles,
        "equations": equations,
        "tolerance": SETTINGS.tolerance,
    }
    return Ensemble(
        shape, SETTINGS.stokes, SETTINGS.slow_time * SETTINGS.stokes, _STARTS, **options
    )


def _starts(ensemble: Ensemble, particles: int, seed: int = _SEED) -> np.ndarray:
    """Starting states of particles in the ensemble's form, shape (n, d)."""
    drawn = _STARTS.draw(ensemble.ellipsoid, np.random.SeedSequence(seed), particles)
    return drawn.states(ensemble.form, ensemble.ellipsoid)


def _alternate(
    *functions: Callable[[], Any], rounds: int | None = None
) -> list[tuple[list[float], Any]]:
    """Processor times of each of several functions in turns, in seconds, and what its first run returned.

    The first run, which compiles, is not timed.
    """
    results = [function() for function in functions]
    times: list[list[float]] = [[] for _ in functions]
    patience = Patience(sentinel, share=_WAITING_SHARE)
    with collector_off():
        for _ in range(rounds or SETTINGS.rounds):
            for function_times, function in zip(times, functions, strict=True):
                patience.steady()
                began = process_time()
                function()
                function_times.append(process_time() - began)
    return list(zip(times, results, strict=True))


def _of_most_turns(times: list[float], particles: int) -> float:
    """Particles per second that three turns in four reach (`_MOST_TURNS`)."""
    return particles / float(np.quantile(times, _MOST_TURNS))
