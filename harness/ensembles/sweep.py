"""Sweeps: a grid of shapes × Stokes numbers, as data, run into a store by any engine.

A pair of shape and St is an `Ensemble`, its particles come in blocks, and a block is a `Task`. The store
has a record for each task, so that an interrupted sweep goes on. `docs/scaling.md` shows a sweep file;
`SweepTable` has all of its keys, and `Ensemble` says what they mean.
"""

from bisect import bisect_right
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate, chain, product
from math import gcd, inf
from pathlib import Path
from random import randrange
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field, model_validator

from polhode.harness.answers.averaging_laws import ORDER_ONE, most_error
from polhode.harness.common.code_digest import code_digest
from polhode.harness.common.files import digest, dumps
from polhode.harness.common.machine import commit, machine, surroundings_of
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record, Store
from polhode.harness.ensembles.engines import Engine
from polhode.harness.ensembles.ensemble import BOUNDS, Ensemble, Equations, Task, run_task
from polhode.harness.ensembles.hybrid import ERROR_OVER_TOLERANCE
from polhode.harness.ensembles.starts import Starts
from polhode.harness.ensembles.statistics import Statistics
from polhode.harness.studies.study import Name, StokesNumbers
from polhode.models.files.scene_file import FlowTable, Positive, SemiAxes, Table, one_duration
from polhode.models.files.toml_file import checked, read_toml
from polhode.models.files.track_file import read_track
from polhode.models.form import FormNotValidError
from polhode.models.problem import ROUNDING
from polhode.models.shape import Ellipsoid

# Written into every record: side by side, tasks slow each other down.
NO_TIMES = "no times: tasks may run side by side"


class SweepFlowTable(FlowTable):
    """``[flow]`` of a sweep: as in a scene, or `tracks`, a folder of one CSV file per particle."""

    tracks: str | None = None

    # Sets of keys, one of which is given.
    ways: ClassVar[tuple[str, ...]] = (*FlowTable.ways, "tracks")

    def flows(self, folder: Path) -> dict[str, Any]:
        """The ensemble's `flow` or `tracks`; particles take the files in the order of their names."""
        if self.tracks is None:
            return {"flow": self.flow(folder)}
        files = sorted((folder / self.tracks).glob("*.csv"))
        if not files:
            raise ValueError(
                f"flow.tracks: got {self.tracks!r}, expected a folder with CSV files: there are none"
            )
        return {"tracks": tuple(map(read_track, files))}


class SweepTable(Table):
    """A sweep file; by default the folder of its results has its name."""

    name: Name
    title: str
    shapes: Annotated[list[SemiAxes], Field(min_length=1)]
    stokes: StokesNumbers
    slow_time: Positive | None = None
    time: Positive | None = None
    start: Starts = Starts()
    flow: SweepFlowTable | None = None
    equations: Equations | None = None
    # From `ROUNDING` on: below it rounding makes the error, not the tolerance.
    tolerance: Annotated[float, Field(ge=ROUNDING, le=1)] | None = None
    # `Ensemble` checks their ranges.
    particles: int = Ensemble.particles
    block: int = Ensemble.block
    seed: int = Ensemble.seed
    samples: int = Ensemble.samples
    snapshots: int = Ensemble.snapshots
    bins: int = Ensemble.bins
    radius: float = Ensemble.radius

    _one_duration = model_validator(mode="after")(one_duration)


@dataclass(frozen=True)
class Sweep:
    """Ensembles under one name."""

    name: str
    title: str
    ensembles: tuple[Ensemble, ...]

    def tasks(self) -> Iterator[Task]:
        """All tasks, ensemble by ensemble."""
        return chain.from_iterable(ensemble.tasks() for ensemble in self.ensembles)

    @property
    def size(self) -> int:
        """Number of tasks."""
        return self._ends[-1]

    def task(self, number: int) -> Task:
        """The task of a number from 0 to `size` - 1, in the order of `tasks`."""
        place = bisect_right(self._ends, number)
        first = self._ends[place - 1] if place else 0
        return Task(self.ensembles[place], number - first)

    @cached_property
    def _ends(self) -> list[int]:
        """Number of tasks up to and with each ensemble."""
        return [*accumulate(ensemble.size for ensemble in self.ensembles)]


class Tally(NamedTuple):
    """Counts of a run of a sweep."""

    finished: int  # tasks done by it
    found: int  # tasks that the store held already, or another run added meanwhile
    failed: int
    message: str  # of the last failure


def in_random_order(count: int) -> Iterator[int]:
    """Each number from 0 to `count` - 1 once, in an order that differs from call to call; no list is made of them."""
    # Not seeded: runs that share a store are to take different orders.
    start = randrange(count)
    stride = randrange(1, count + 1)
    # Steps of a stride that shares no factor with the count visit every number.
    while gcd(stride, count) > 1:
        stride = randrange(1, count + 1)
    return ((start + stride * place) % count for place in range(count))


def perform(task: Task) -> Record:
    """Record of a task: its statistics, the machine and the code that ran it, and that no times were taken."""
    measured = {"machine": machine(), "commit": commit(), "code": code_digest()}
    return {"statistics": run_task(task), **measured, "timing": NO_TIMES}


def run_sweep(
    sweep: Sweep, store: Store, engine: Engine, *, quiet: bool = False, spread: bool = False
) -> Tally:
    """Run what the store does not hold yet; several runs may share it, at the same time too.

    A task that fails is counted, and tried again by the next run. With `spread` the tasks are taken in random
    order, so that such runs seldom work on the same one.
    """
    finished = 0
    failed = 0
    message = ""
    progress = Steps(sweep.name, sweep.size, "tasks", quiet)
    tasks = map(sweep.task, in_random_order(sweep.size)) if spread else sweep.tasks()
    # A task is looked up when its turn comes: another run may have added its record.
    missing = (task for task in tasks if task.key not in store)
    with progress, closing(engine(perform, missing)) as outcomes:
        for outcome in outcomes:
            if outcome.value is None:
                failed += 1
                message = outcome.message
            else:
                store.put(outcome.task.key, outcome.task.content, outcome.value)
                finished += 1
            progress.advance()
    return Tally(finished, sweep.size - finished - failed, failed, message)


def gather(ensemble: Ensemble, store: Store) -> Statistics:
    """Statistics of an ensemble from the store, merged in the order of its tasks; ValueError if it lacks one."""
    total = Statistics.empty(ensemble.layout)
    for task in ensemble.tasks():
        record = store.result(task.key)
        if record is None:
            raise ValueError(
                f"{store.path}: task {task.index} is missing, expected a finished sweep; --resume"
            )
        total.merge(Statistics.from_record(record["statistics"], task.ensemble.layout))
    return total


def surroundings(sweep: Sweep, store: Store) -> list[Record]:
    """Days, machines, versions and code of a sweep's tasks, each once."""
    ensembles = {digest(ensemble.content) for ensemble in sweep.ensembles}
    names = sweep.ensembles[0].content.keys()
    entries = dict[str, Record]()
    for record in store:
        if digest({name: record.get(name) for name in names}) in ensembles:
            # An ISO date begins with the ten characters of the day.
            entry = {**surroundings_of(record), "date": record["date"][:10]}
            entries[dumps(entry)] = entry
    return [*entries.values()]


def read_sweep(path: Path | None) -> Sweep:
    """Read a sweep file, or the one that comes with the package; raises as `read_toml` does."""
    path = path or Path(__file__).with_name("default_sweep.toml")
    return read_toml(path, partial(parse_sweep, folder=path.parent))


def parse_sweep(contents: dict[str, Any], folder: Path = Path()) -> Sweep:
    """Make a sweep of the contents of a sweep file; the paths in it are relative to `folder`.

    Raises ValueError as `checked` does, and if a shape with its St stands there twice.
    """
    table = checked(SweepTable, contents)
    flows = table.flow.flows(folder) if table.flow else {}
    grid = product(table.shapes, table.stokes)
    ensembles = tuple(_ensemble(table, shape, stokes, flows) for shape, stokes in grid)
    if len({Task(ensemble, 0).key for ensemble in ensembles}) < len(ensembles):
        raise ValueError("shapes, stokes: got the same twice, expected each once")
    return Sweep(table.name, table.title, ensembles)


def _ensemble(
    table: SweepTable, shape: list[float], stokes: float, flows: dict[str, Any]
) -> Ensemble:
    """The ensemble of one shape and St of a sweep."""
    # St = 0 or inf, and an underflow or overflow, leave no time that a run could last.
    time = table.time or (table.slow_time or 0.0) * stokes
    if time in (0, inf):
        raise ValueError(
            f"slow_time: got {table.slow_time!r} at stokes = {stokes:g}, expected time"
        )
    a, b, c = shape
    limits = table.model_dump(include={*BOUNDS, "radius"})
    ensemble = partial(Ensemble, Ellipsoid((a, b, c)), stokes, time, table.start, **flows, **limits)
    tolerance = table.tolerance or Ensemble.tolerance
    # If averaging is good enough, and takes the starts, it is the cheaper by far: its cost does not
    # grow with St.
    if (
        not table.equations
        and stokes < inf
        and most_error(ORDER_ONE, stokes) <= tolerance
        and table.start.motion != "rest"
    ):
        with suppress(FormNotValidError):
            # The file's tolerance is meant as an error: averaged equations keep it at a smaller one.
            return ensemble(equations="averaged", tolerance=tolerance / ERROR_OVER_TOLERANCE)
    return ensemble(equations=table.equations or "full", tolerance=tolerance)
