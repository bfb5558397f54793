"""Statements of the study over random bodies, made anew: what `solve` states today of the runs in its tables.

The study's references take hours, its statements minutes. `polhode accuracy --restate` runs this where the
factors of statements, or the estimates of the theory, have changed. Errors stay as they were measured.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext, suppress
from math import isnan
from multiprocessing import get_context
from typing import Any

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

# Columns of the table of errors that are made anew.
_COLUMNS = [*columns_up_to("bound"), *columns_up_to("turned_bound")]


def restate(store: Store, old: Data, *, workers: int = 0, quiet: bool = False) -> Data:
    """The tables of a study with today's statements.

    Parameters
    ----------
    store : Store
        Takes every finished task, so that an interrupted run goes on.
    old : Data
        The study.
    workers : int
        Processes; 0 for this one alone.
    quiet : bool
        Show no progress.
    """
    errors = old.errors.copy()
    # What `random_study.measure` states: of all runs by `hybrid`, and of averaged runs at some St.
    hybrid = errors["form"] == Hybrid.name
    stated = hybrid | (errors["stokes"].isin(STATED_STOKES) & (errors["body"] < STATED_BODIES))
    ended = errors[columns_up_to("slow")].notna().any(axis=1)
    # By the key of a task in the store: where its rows are in the table, and the rows.
    places = {}
    rows = {}
    for task, group in errors[stated & ended].groupby(TASK_COLUMNS):
        key = digest(["restated", factors(), *task])
        places[key] = group.index
        rows[key] = group.to_dict("records")
    known = store.keys()
    left = [key for key in rows if key not in known]
    pool: Any = nullcontext()
    if workers:
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    with Steps("statements", len(left), "tasks", quiet) as progress, pool as executor:
        in_turn = executor.map if workers else map
        for key, statements in zip(
            left, in_turn(_stated, [rows[key] for key in left]), strict=True
        ):
            store.put(key, {}, {"statements": statements, **surroundings()})
            progress.advance()
    records = [record for record in store if record["key"] in places]
    for record in records:
        for place, statement in zip(places[record["key"]], record["statements"], strict=True):
            errors.loc[place, _COLUMNS] = [statement.get(name) for name in _COLUMNS]
    return old._replace(errors=errors, timed=timed_of(records, old))


def _stated(rows: Sequence[Record]) -> list[dict[str, float]]:
    """What `solve` states of the runs of one task, in their columns; none of a run that states nothing.

    The rows are those of the table of errors.
    """
    statements = []
    for row in rows:
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
