"""Rows of the studies of averaging, and the files beside their pages.

A study is a dataclass. Each field holds the rows of one table, dataclasses too, but for `timed`. A table is
a CSV file with the field's name.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from polhode.harness.common.files import read_file, write_file
from polhode.harness.common.store import Record, read_table, write_table

# File that says when and where a study was measured, and of how many runs each time is the fastest.
_TIMED = "timed.json"


@dataclass(frozen=True)
class SecondOrderErrors:
    """Errors of second order away from resonances: slow ones over I_max, orientation in rad.

    "Slow" is the error of L and E, the slow variables. Each error is the largest of a run.
    """

    shape: str  # semi-axes, a:b:c
    start: str  # a name or an angular velocity, as in `cases.toml`
    slow_time: float  # duration over St
    stokes: float
    slow: float
    orientation: float
    first_order_slow: float  # error of L and E of the form averaged to first order
    estimated_slow: float  # what the form states ahead of the run
    estimated_orientation: float
    slow_uncertainty: float  # how far the reference may be off
    orientation_uncertainty: float


@dataclass(frozen=True)
class Passage:
    """A run through resonances or up to L² = 2EI₂: columns as in `SecondOrderErrors`, wall times in s."""

    shape: str
    start: str
    slow_time: float
    stokes: float
    # Modes (k₁, k₂) whose kicks the form leaves out, in the order in which the run meets them. Weak kicks are
    # not named (`second_order._NAMED_KICK`).
    modes: str = ""
    kick: float = nan  # the largest change of L by one of these kicks, over I_max
    slow: float = nan
    estimated_slow: float = nan
    first_order_slow: float = nan
    orientation: float = nan
    estimated_orientation: float = nan
    integration: float = nan  # of the integration alone
    seconds: float = nan  # of the integration and of the observables at all samples
    refused: str = ""  # why the form does not follow the run; empty if it does


@dataclass(frozen=True)
class Cost:
    """Wall times of one run in s, and its error."""

    form: str
    solver: str
    tolerance: float
    stokes: float
    samples: int  # output times
    integration: float  # of the integration alone
    seconds: float  # of the integration and of the observables at all samples
    slow: float  # error of L and E over I_max, NaN if unknown


@dataclass(frozen=True)
class SecondOrderStudy:
    """All that is measured of the second order."""

    orders: Sequence[SecondOrderErrors]
    resonances: Sequence[Passage]
    crossings: Sequence[Passage]  # of runs cut before L² = 2EI₂
    cost: Sequence[Cost]
    timed: dict[str, Record]  # when and where each part was measured, by the part's name


Study = TypeVar("Study")


def write_study(study: Any, folder: Path) -> None:
    """Write each of a study's tables into a folder, and `timed.json`, with their checksums beside them."""
    for name, kind in _tables(type(study)).items():
        write_table(folder / f"{name}.csv", kind, getattr(study, name))
    write_file(folder / _TIMED, json.dumps(study.timed, indent=2) + "\n", summed=True)


def read_study(kind: type[Study], folder: Path) -> Study:
    """Read what `write_study` wrote.

    Raises ValueError where a table is missing or damaged, OSError where `timed.json` is missing.
    """
    rows = _tables(kind).items()
    tables = {name: read_table(folder / f"{name}.csv", row) for name, row in rows}
    study_kind: Any = kind
    return study_kind(**tables, timed=json.loads(read_file(folder / _TIMED)))


def _tables(kind: type) -> dict[str, type]:
    """The kind of row of each table of a study, from the types of its fields: `Sequence[Cost]` gives `Cost`."""
    return {
        name: get_args(hint)[0] for name, hint in get_type_hints(kind).items() if name != "timed"
    }
