"""Ensembles: many particles of one shape and Stokes number, run in tasks that are pure functions of plain data.

`Ensemble` is the description, `Task` a block of its particles, `run_task` what an engine
(`polhode.harness.ensembles.engines`) calls. `polhode.harness.ensembles.statistics` keeps sums over the
particles, and nothing of a single one. `docs/scaling.md` says which equations run by which method.
In shapes, n counts particles, m times, and d components of a state.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isfinite
from numbers import Integral
from typing import Literal

import numpy as np

from polhode.harness.answers.averaging_laws import ORDER_ONE, most_error
from polhode.harness.common.files import digest
from polhode.harness.common.store import Record
from polhode.harness.common.text import scientific
from polhode.harness.ensembles.hybrid import BOTH_WAYS, POOL, SOLVER, least_momentum, run_hybrid
from polhode.harness.ensembles.starts import Drawn, Starts
from polhode.harness.ensembles.statistics import RATES, Layout, Statistics, squared_rates
from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.files.scene_file import flow_table, plain
from polhode.models.flow import Flow
from polhode.models.libraries import version_of
from polhode.models.observables import angular_velocity
from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.models.theory.fixed_points import Attractor, attractors
from polhode.solvers.catalogue import available_like
from polhode.solvers.contract import Status, installed
from polhode.solvers.ensembles.adaptive_steps import run_adaptive
from polhode.solvers.ensembles.equal_steps import TAYLOR, Plan, plan, run
from polhode.solvers.ensembles.one_by_one import run_one_by_one
from polhode.solvers.ensembles.taylor_batch import run_batches

# Changes whenever a record's meaning does, so that no old record is taken for a new one.
_SCHEMA = 5
# Particles on which method and step are chosen. An estimate: half as many see fewer of the hard starts, twice
# as many take twice the time of the choice.
PLANNED_PARTICLES = 128
# Most numbers of states that are held at once, 8 bytes each, so 16 MB; their observables take a few times
# as much. An estimate: memory grows in proportion.
_MAX_NUMBERS_HELD = 2_000_000
# Most particles that are held at once, if each has few samples. An estimate, in the thousands so that lanes
# (particles side by side in SIMD registers) are seldom empty.
_MAX_PARTICLES_HELD = 8192
# Most states whose observables are held at once: they stay in the processor's cache. An estimate: a few
# MB at some ten numbers of 8 bytes each.
_MAX_STATES_OBSERVED = 20_000
# Angular velocities stay below the fastest start, or about the angular velocity of the fluid, ½ in simple
# shear: 1 is the least limit of |L| over I_max. Histograms reach further by the factor `MARGIN`, an estimate.
_LEAST_LIMIT = 1.0
MARGIN = 1.05
# The whole numbers of an ensemble, least and most. The seed has 63 bits; a run has two times, its start and its
# end, at least. The others are estimates, far beyond what is of use.
BOUNDS = {
    **dict.fromkeys(("particles", "block"), (1, 10**12)),
    "seed": (0, 2**63 - 1),
    "samples": (2, 10**6),
    "snapshots": (2, 10**4),
    "bins": (1, 10**4),
}

Equations = Literal["full", "averaged", "hybrid"]


@dataclass(frozen=True)
class Ensemble:
    """Many starts of one shape and Stokes number; raises ValueError if a value is out of range.

    Orientations and directions of the starts depend on `seed` and the block's index alone: neither on
    shape and St nor on who runs what. A particle has arrived when its L and E, over the largest moment of
    inertia, stay close to the motion on an attractor: within `radius` of it up to the end.
    """

    ellipsoid: Ellipsoid
    stokes: float
    time: float  # in units of the inverse shear rate
    starts: Starts = field(default_factory=Starts)
    # A share of them is then known to 0.5 % at most, one standard deviation; an estimate of what is asked.
    particles: int = 10_000
    seed: int = 1
    # "full" in the fewest variables without angles, "averaged" to first order, or the form "hybrid".
    equations: Equations = "full"
    # For full equations: the error of `equal_steps.plan`. For hybrid ones: the error of L and E over
    # the largest moment of inertia, meant for 97.5 % of the particles. For averaged ones: the
    # tolerance of `run_adaptive`. The default is far below the statistical errors of any number of particles.
    tolerance: float = 1e-6
    # Particles of one task, which are lost if its worker dies. An estimate: at St = 1e3 a task of full equations
    # lasts tenths of a second (reports/sweep/throughput.md), and longer in proportion to St.
    block: int = 10_000
    # Equispaced times at which arrival is looked for, start and end included: arrival is known to 1 % of the run.
    samples: int = 101
    # Samples at which moments and distributions are kept: evenly spaced, start and end included, so that samples - 1
    # is divisible by snapshots - 1. An estimate: memory and pages grow in proportion.
    snapshots: int = 11
    # Number of bins of a histogram. An estimate: 10,000 particles leave some 150 in a bin.
    bins: int = 64
    # Distance in (L, E) over I_max within which a particle has arrived: as `polhode.harness.events.ARRIVED`.
    radius: float = 0.05
    flow: Flow | None = None  # of all particles; simple shear by default
    # One for each particle in turn, from the first one again behind the last, in place of `flow`.
    tracks: tuple[Flow, ...] = ()

    def __post_init__(self) -> None:
        for name, (least, most) in BOUNDS.items():
            value = getattr(self, name)
            if not (isinstance(value, Integral) and least <= value <= most):
                raise ValueError(
                    f"{name}: got {value!r}, expected a whole number from {least} to {most}"
                )
        if (self.samples - 1) % (self.snapshots - 1):
            raise ValueError(
                f"snapshots: got {self.snapshots}, expected samples - 1 = {self.samples - 1} divisible"
            )
        for name in ("tolerance", "radius"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name}: got {value!r}, expected a finite positive number")
        if self.equations == "averaged" and self.starts.motion == "rest":
            raise ValueError(
                "start.motion: got 'rest' with averaged equations, expected L not 0; use 'full'"
            )
        # Refuses what the form does not take.
        _ = self.problem
        for number, track in enumerate(self.tracks, 1):
            try:
                # Refuses one that ends before the run.
                replace(self.any_scene, flow=track)
            except ValueError as error:
                raise ValueError(f"track {number} of {len(self.tracks)}: {error}") from None

    @property
    def problem(self) -> Problem:
        """Problem of all particles but for their starts."""
        return find_form("hybrid" if self.equations == "hybrid" else self.form).problem(
            self.any_scene
        )

    @property
    def form(self) -> str:
        """Catalogue name of the form of the states; `hybrid` has the states of full equations."""
        return (
            averaged_form(self.any_scene)
            if self.equations == "averaged"
            else full_form(self.any_scene)
        )

    @property
    def method(self) -> str:
        """The method that runs the particles, in words."""
        if self.equations == "averaged":
            error = scientific(most_error(ORDER_ONE, self.stokes))
            return f"Dormand and Prince's pair, averaging's error up to {error}"
        if self.equations == "hybrid":
            if (least := least_of(self)) == inf:
                return f"{available_like(SOLVER)}, error {scientific(self.tolerance)}"
            return f"averaged, where |L| falls below {least:.2g} I_max full or {available_like(SOLVER)}"
        if self.along_tracks:
            return f"{available_like(SOLVER)}, one by one"
        chosen = plan_of(self)
        if chosen is not None:
            return f"{chosen.method}, error {scientific(chosen.error)}"
        return "Taylor's method" if installed("heyoka") else available_like(SOLVER)

    @property
    def slow_time(self) -> float | None:
        """Duration in slow time; None at St = 0."""
        return None if self.stokes == 0 else self.time / self.stokes

    @cached_property
    def attractors(self) -> tuple[Attractor, ...]:
        """The stable states of simple shear that particles can arrive at (`polhode.models.theory.fixed_points`)."""
        if self.any_scene.flow is not None:
            return ()
        return attractors(
            self.ellipsoid, self.stokes, self.radius, circling=self.equations != "averaged"
        )

    @cached_property
    def layout(self) -> Layout:
        """The counted quantities and their bins."""
        # All axes of a triaxial body count, in the order of their lengths; of a spheroid its symmetry
        # axis; of a sphere the third one. Averaged equations leave the orientation open: none counts.
        shape = self.ellipsoid
        start_momentum = self.starts.angular_momentum
        if self.equations == "averaged":
            axes = ()
        elif shape.kind == "triaxial":
            axes = shape.order
        else:
            axes = (2 if shape.symmetry_axis is None else shape.symmetry_axis,)
        momentum = _LEAST_LIMIT
        # Over I_max: E = |L|²/(2 I_max) of a rotation about the axis of the largest inertia with |L| = I_max.
        energy = _LEAST_LIMIT / 2
        if start_momentum is not None:
            momentum = max(momentum, float(np.linalg.norm(start_momentum)))
            # At a given |L| a rotation about the axis of the least inertia has the largest E.
            energy = max(energy, momentum**2 / 2 * max(shape.inertia) / min(shape.inertia))
        return Layout(
            axes=axes,
            snapshots=self.snapshots,
            samples=self.samples,
            attractors=len(self.attractors),
            bins=self.bins,
            largest_momentum=MARGIN * momentum,
            largest_energy=MARGIN * energy,
        )

    @property
    def content(self) -> Record:
        """The ensemble as plain data, types coerced, with the schema and the versions that it depends on."""
        flows = self.tracks or (self.any_scene.flow,)
        tables = [plain(flow_table(flow)) for flow in flows if flow is not None]
        return {
            "schema": _SCHEMA,
            **({"flow": tables} if tables else {}),
            "semi_axes": [float(length) for length in self.ellipsoid.semi_axes],
            "starts": dict(self.starts),
            "equations": self.equations,
            "form": self.form,
            **{name: int(getattr(self, name)) for name in BOUNDS},
            **{
                name: float(getattr(self, name))
                for name in ("stokes", "time", "tolerance", "radius")
            },
            "versions": {
                name: version_of(name)
                for name in ("polhode", "heyoka", "llvmlite", "numpy", "cyrk", "scipy")
            },
        }

    def tasks(self) -> Iterator["Task"]:
        """The blocks of particles, in order; all but the last are of the same size."""
        return (Task(self, index) for index in range(self.size))

    @property
    def size(self) -> int:
        """Number of tasks."""
        return (self.particles + self.block - 1) // self.block

    def draw(self, index: int, particles: int) -> Drawn:
        """Starts of the first `particles` particles of the block `index`."""
        seed = np.random.SeedSequence(self.seed, spawn_key=(index,))
        flow = self.any_flow.numbers if self.any_flow else None
        if self.tracks:
            flows = [self.flow_of(index * self.block + i) for i in range(particles)]
            flow = list(np.array([particle_flow.numbers for particle_flow in flows]).T)
        return self.starts.draw(self.ellipsoid, seed, particles, flow)

    @property
    def any_flow(self) -> Flow | None:
        """The flow of the very first particle."""
        return self.tracks[0] if self.tracks else self.flow

    @property
    def along_tracks(self) -> bool:
        """Whether the flow changes on the way."""
        return self.any_flow is not None and self.any_flow.varies

    def flow_of(self, particle: int) -> Flow:
        """The flow of a particle, by its number in the ensemble: its track, or the one flow of all."""
        flow = self.tracks[particle % len(self.tracks)] if self.tracks else self.flow
        assert flow is not None, "an ensemble along tracks"
        return flow

    @cached_property
    def any_scene(self) -> Scene:
        """Scene of the very first particle, whose start the others replace."""
        drawn = self.draw(0, 1)
        q0, q1, q2, q3 = drawn.quaternion[0].tolist()
        w1, w2, w3 = drawn.angular_velocity[0].tolist()
        start = BodyStart((q0, q1, q2, q3), (w1, w2, w3))
        return Scene(self.ellipsoid, self.stokes, start, self.time, self.any_flow)

    def run(self, index: int) -> Statistics:
        """Statistics of the block `index` of particles, in bounded memory.

        Particles run in groups of `at_once`. Each group draws its phases from a seed of its own.
        """
        particles = min(self.block, self.particles - index * self.block)
        problem = self.problem
        starts = self.draw(index, particles).states(self.form, self.ellipsoid)
        # In a flow that varies the time is a state's last component.
        if self.along_tracks:
            starts = np.column_stack([starts, np.zeros(particles)])
        times = np.linspace(0.0, problem.end, self.samples)
        statistics = Statistics.empty(self.layout)
        fitting = max(1, _MAX_NUMBERS_HELD // (self.samples * problem.dimension))
        at_once = min(_MAX_PARTICLES_HELD, fitting)
        for first in range(0, particles, at_once):
            random = np.random.default_rng(
                np.random.SeedSequence(self.seed, spawn_key=(index, first))
            )
            part = starts[first : first + at_once]
            # Numbers of these particles among all of the ensemble.
            numbers = index * self.block + first + np.arange(len(part))
            if self.along_tracks:
                states, statuses = self._run_along_tracks(part, times, numbers)
            else:
                states, statuses = self.states(part, times, random)
            success = statistics.add_statuses(statuses, str(Status.REACHED_END))
            # The particles come first, as `_observe` takes them.
            finished = states.swapaxes(0, 1)
            self._observe(
                finished if success.all() else finished[success], statistics, numbers[success]
            )
        return statistics

    def states(
        self, starts: np.ndarray, times: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, ...]:
        """States, shape (m, n, d), of particles at times, and statuses, shape (n,).

        States of a particle that failed are NaN from where it failed, or at all times. Phases that hybrid
        equations leave open are drawn from `random`.
        """
        if self.equations == "averaged":
            return run_adaptive(self.problem, starts, times, self.tolerance)
        if self.equations == "hybrid":
            return run_hybrid(self.any_scene, starts, times, self.tolerance, least_of(self), random)
        if (chosen := plan_of(self)) is not None:
            return run(self.problem, starts, times, self.tolerance, chosen)
        # `TAYLOR` makes the error of a whole run a tolerance of a step.
        return run_batches(self.problem, starts, times, self.tolerance * TAYLOR)

    def _run_along_tracks(
        self, starts: np.ndarray, times: np.ndarray, numbers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States and statuses, as of `states`, of particles of these numbers, one by one."""
        equations = find_form(self.form)
        runs = []
        for start, number in zip(starts, numbers.tolist(), strict=True):
            problem = equations.problem(replace(self.any_scene, flow=self.flow_of(number)))
            runs.append(run_one_by_one(problem, start[None], times, self.tolerance * TAYLOR))
        states = np.concatenate([path for path, _ in runs], axis=1)
        return states, np.concatenate([statuses for _, statuses in runs])

    def _observe(self, states: np.ndarray, statistics: Statistics, numbers: np.ndarray) -> None:
        """Add states, shape (n, samples, d), of particles of these numbers to the statistics."""
        n, samples, d = states.shape
        form = find_form(self.form)
        scene = self.any_scene
        axes = list(self.layout.axes)
        unit = max(self.ellipsoid.inertia)
        # Samples from one snapshot to the next. Arrays whose name ends in `_then` hold values at snapshots.
        every = (samples - 1) // (self.snapshots - 1)
        slow_then = np.empty((self.snapshots, n, 4))
        directions_then = np.empty((self.snapshots, n, len(axes), 3))
        rates_then = np.empty((self.snapshots, n, len(axes), len(RATES)))
        # Whether each particle is close to an attractor at each sample: within its `reach`, that is `radius`
        # beyond the motion on it.
        close = np.empty((len(self.attractors), n, samples), dtype=bool)
        at_once = 1 if self.along_tracks else max(1, _MAX_STATES_OBSERVED // samples)
        for first in range(0, n, at_once):
            part = slice(first, first + at_once)
            # Component by component in memory: NumPy sums over components faster so.
            columns = np.moveaxis(states[part], 2, 0).reshape(d, -1)
            if self.along_tracks:
                scene = replace(scene, flow=self.flow_of(int(numbers[first])))
            observables = form.observe(scene, columns.T)
            components = (*observables.angular_momentum.T, observables.energy)
            slow = [component.reshape(-1, samples) / unit for component in components]
            for place, attractor in enumerate(self.attractors):
                square_distance = sum(
                    np.square(component - target)
                    for component, target in zip(slow, attractor.state, strict=True)
                )
                close[place, part] = square_distance < attractor.reach**2
            slow_then[:, part] = np.stack([component[:, ::every].T for component in slow], axis=-1)
            # Rows of the snapshots among all states of these particles, shape (snapshots, particles).
            rows = np.arange(columns.shape[1]).reshape(-1, samples)[:, ::every].T
            at_snapshots = observables[rows.ravel()]
            directions = at_snapshots.rotation[:, axes]
            directions_then[:, part] = directions.reshape(*rows.shape, len(axes), 3)
            rates = squared_rates(angular_velocity(self.ellipsoid, at_snapshots), directions)
            rates_then[:, part] = rates.reshape(*rows.shape, len(axes), len(RATES))
        statistics.add_orientations(directions_then)
        statistics.rates += rates_then.sum(axis=1)
        statistics.rates_squares += np.square(rates_then).sum(axis=1)
        statistics.add_slow(self.layout, slow_then)
        for place in range(len(self.attractors)):
            statistics.add_arrivals(place, close[place].T)


@once()
def plan_of(ensemble: Ensemble) -> Plan | None:
    """How equal steps run the particles of full equations; None where they do not keep the error.

    Taylor's method runs the particles then, and where llvmlite, which compiles equal steps, is missing.
    """
    if not installed("llvmlite"):
        return None
    problem = ensemble.problem
    sample = ensemble.draw(0, PLANNED_PARTICLES).states(ensemble.form, ensemble.ellipsoid)
    return plan(
        problem, sample, np.linspace(0.0, problem.end, ensemble.samples), ensemble.tolerance
    )


@once()
def least_of(ensemble: Ensemble) -> float:
    """|L| over I_max down to which hybrid particles are averaged; inf if form `hybrid` runs all of them."""
    # So few particles cost no more than those that run averaged and by form `hybrid` to find the least |L|.
    if ensemble.particles <= BOTH_WAYS:
        return inf
    pool = ensemble.draw(0, min(POOL, ensemble.particles)).states(ensemble.form, ensemble.ellipsoid)
    return least_momentum(ensemble.any_scene, pool, ensemble.tolerance)


@dataclass(frozen=True)
class Task:
    """A block of an ensemble's particles: what an engine runs, and a row of the store."""

    ensemble: Ensemble
    index: int

    @property
    def content(self) -> Record:
        """The task as plain data."""
        return {**self.ensemble.content, "index": self.index}

    @cached_property
    def key(self) -> str:
        """Hash of the canonical content."""
        return digest(self.content)


def run_task(task: Task) -> Record:
    """Statistics of a task as plain data: a pure function, with nothing of time, place or machine in its result.

    Raises RuntimeError if the task was made by other versions than run here.
    """
    if digest(task.content) != task.key:
        raise RuntimeError(f"got a task of other versions, expected {task.content['versions']}")
    return task.ensemble.run(task.index).as_record()
