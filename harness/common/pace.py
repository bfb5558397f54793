"""The pace of a machine: by how much a moment was slower or faster than usual, as its sentinel tells."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Pace:
    """What the sentinel usually takes on a machine.

    Run times follow the sentinel (`timing.sentinel`), so that moments of a machine that halves its speed now and
    then can be compared. Another Python makes the sentinel faster or slower, but not the solvers: only records of the
    same machine and Python are compared.

    Parameters
    ----------
    machine : mapping, optional
        As `polhode.harness.common.machine.machine` tells it.
    sentinel : float, optional
        Seconds.
    """

    machine: Mapping[str, Any] | None
    sentinel: float | None

    @classmethod
    def usual(cls, records: Iterable[Mapping[str, Any]]) -> "Pace":
        """Pace of timed records: the machine of the last one, and the median of the sentinel there."""
        timed = [record for record in records if "seconds" in record and _sentinel(record)]
        if not timed:
            return cls(None, None)
        machine = timed[-1].get("machine")
        return cls(machine, median(_sentinel(record) for record in timed if record.get("machine") == machine))

    def seconds(self, record: Mapping[str, Any]) -> float:
        """Wall time of a record at this pace; as timed if its machine is another one, or if no sentinel tells."""
        seconds, found = float(record["seconds"]), _sentinel(record)
        comparable = self.sentinel and found and record.get("machine") == self.machine
        return seconds * self.sentinel / found if comparable and self.sentinel else seconds


def _sentinel(record: Mapping[str, Any]) -> float:
    """The sentinel's time beside a record; 0 where it is not known."""
    found = record.get("sentinel_seconds")
    return found if found and found < inf else 0.0
