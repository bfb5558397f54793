"""Statements of the study over random bodies, made anew: what `solve` states today of the runs in its tables.

The study's references take hours, its statements minutes. `polhode accuracy --restate` runs this where the
factors of statements, or the estimates of the theory, have changed. Errors stay as they were measured.
"""

from collections.abc import Callable, Generator, Iterable
from contextlib import closing, suppress
from math import isnan
from typing import Any, NamedTuple

from polhode.harness.answers.fitted import factors
from polhode.harness.averaging.bodies import drawn
from polhode.harness.averaging.random_study import (
    STATED_BODIES,
    STATED_STOKES,
    STUDIED_SLOW_TIMES,
    TASK_COLUMNS,
    Data,
    Task,
    columns_up_to,
    hybrid_run,
    stated_by_hybrid,
    stated_of,
    timed_of,
)
from polhode.harness.common.files import digest
from polhode.harness.common.machine import surroundings
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record, Store
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.hybrid.form import Hybrid

# Runs a function on tasks, as `polhode.harness.ensembles.engines.Engine` says; the outcomes have a task, a value
# and a message.
_Engine = Callable[[Callable[[Any], Any], Iterable[Any]], Generator[Any, None, None]]
# Columns of the table of errors that are made anew.
_COLUMNS = [*columns_up_to("bound"), *columns_up_to("turned_bound")]


class _Runs(NamedTuple):
    """The runs of one task whose statements are made anew."""

    key: str  # in the store
    rows: list[Record]  # in the table of errors


def restate(store: Store, old: Data, engine: _Engine, *, quiet: bool = False) -> Data:
    """The tables of a study with today's statements.

    Parameters
    ----------
    store : Store
        Takes every finished task, so that an interrupted run goes on.
    old : Data
        The study.
    engine : Callable
        Runs the tasks, as `polhode.harness.ensembles.engines` says.
    quiet : bool
        Show no progress.

    Raises
    ------
    RuntimeError
        If a task failed; the message names it.
    """
    errors = old.errors.copy()
    # What `random_study.measure` states: of all runs by `hybrid`, and of averaged runs at some St.
    hybrid = errors["form"] == Hybrid.name
    stated = hybrid | (errors["stokes"].isin(STATED_STOKES) & (errors["body"] < STATED_BODIES))
    ended = errors[columns_up_to("slow")].notna().any(axis=1)
    # Where the rows of a task are in the table, by its key in the store.
    places = {}
    left = []
    known = store.keys()
    for task, group in errors[stated & ended].groupby(TASK_COLUMNS):
        key = digest(["restated", factors(), *task])
        places[key] = group.index
        if key not in known:
            left.append(_Runs(key, group.to_dict("records")))
    progress = Steps("statements", len(left), "tasks", quiet)
    with progress, closing(engine(_stated, left)) as outcomes:
        for runs, statements, message in outcomes:
            if message:
                kind, body, stokes = (runs.rows[0][name] for name in TASK_COLUMNS)
                raise RuntimeError(f"{kind} {body} at St = {stokes:g}: {message}")
            store.put(runs.key, {}, {"statements": statements, **surroundings()})
            progress.advance()
    records = [record for record in store if record["key"] in places]
    for record in records:
        for place, statement in zip(places[record["key"]], record["statements"], strict=True):
            errors.loc[place, _COLUMNS] = [statement.get(name) for name in _COLUMNS]
    return old._replace(errors=errors, timed=timed_of(records, old))


def _stated(runs: _Runs) -> list[dict[str, float]]:
    """What `solve` states of the runs of one task, in their columns; empty for a run that states nothing."""
    statements = []
    for row in runs.rows:
        task = Task(row["kind"], row["body"], row["stokes"])
        body = drawn(task.kind, task.body)
        statement: dict[str, float] = {}
        if row["form"] == Hybrid.name:
            statement = stated_by_hybrid(*hybrid_run(body.scene(task.stokes), row["requested"]))
        else:
            for slow_time in STUDIED_SLOW_TIMES:
                # Second order may follow a run for a part of these times only.
                if isnan(row[f"slow_{slow_time:g}"]):
                    continue
                # A later version of the form may refuse a run that an earlier one followed.
                with suppress(FormNotValidError):
                    statement |= stated_of(body, task, find_form(row["form"]), slow_time)
        # NaN is no JSON.
        statements.append({name: value for name, value in statement.items() if not isnan(value)})
    return statements
