"""Which machine, versions and day a number came from, and the head of a page that says so."""

import os
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from polhode.harness.common.text import percent
from polhode.harness.common.timing import BUSY, HAD, disturbance
from polhode.models.libraries import version_of

_PACKAGES = (
    "polhode",
    "numpy",
    "scipy",
    "llvmlite",
    "numba",
    "heyoka",
    "scikit-sundae",
    "cyrk",
    "pandas",
    "matplotlib",
)
# Seconds between two records beyond which a study stood still.
_PAUSE = 600.0


def machine() -> dict[str, str | int]:
    """Processor, cores, system and Python."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }


def versions() -> dict[str, str]:
    """Versions of the packages that a result depends on; missing ones are left out."""
    numbers = {package: version_of(package) for package in _PACKAGES}
    return {package: number for package, number in numbers.items() if number is not None}


def now() -> str:
    """Date and time in UTC, ISO 8601 to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def here(**more: Any) -> dict[str, Any]:
    """Date, machine and versions of a measurement."""
    return {"date": now(), "machine": machine(), "versions": versions(), **more}


def provenance(command: str, records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines that say how a page was made: by which command, when, on which machines, with which versions.

    Records without a date or a machine leave it out.
    """
    machines = dict.fromkeys(_place(record) for record in records if "machine" in record)
    where = f" on {' and '.join(machines)}" if machines else ""
    disturbed, judged = disturbance(records)
    rule = f"had the processor for less than {percent(HAD)} of its time, or the machine took {BUSY:g} × its shortest"
    runs = f"{judged} timed runs{_took(records)}"
    said = (
        f" Disturbed by other work: {disturbed} of {runs} (the fastest {rule})." if judged else ""
    )
    notice = f"Made by `{command}`. Do not edit: the next run overwrites this page."
    return [notice, "", f"Measured {dates(records)}{where}.{said}", ""]


def made_lines(page: Path) -> list[str]:
    """The lines of a page that say by which command and where it was made, to be kept when it is written anew.

    Raises ValueError if there are none.
    """
    lines = page.read_text(encoding="utf-8").split("\n") if page.is_file() else []
    made = [line for line in lines if line.startswith(("Made by `", "Measured "))]
    if not made:
        raise ValueError(f"{page}: no such file, expected a page of `polhode`")
    return [part for line in made for part in (line, "")]


def dates(records: Sequence[Mapping[str, Any]]) -> str:
    """The day, or the first and the last one, on which records were measured; some may have no date."""
    days = sorted({record["date"][:10] for record in records if record.get("date")})
    if not days:
        return "on an unknown date"
    span = f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}"
    return (
        span if all(record.get("date") for record in records) else f"{span}, and on unknown dates"
    )


def _took(records: Sequence[Mapping[str, Any]]) -> str:
    """In how many minutes records were made, from the first to the last, pauses left out; nothing below a minute."""
    times = sorted(
        datetime.fromisoformat(record["date"]) for record in records if record.get("date")
    )
    gaps = [(later - earlier).total_seconds() for earlier, later in pairwise(times)]
    minutes = sum(gap for gap in gaps if gap < _PAUSE) / 60
    return f", made in {minutes:.0f} minutes" if minutes >= 1.5 else ""


def _place(record: Mapping[str, Any]) -> str:
    machine = record["machine"]
    packages = ", ".join(f"{name} {number}" for name, number in record["versions"].items())
    return (
        "{processor}, {cores} cores, {system}, Python {python}".format(**machine) + f" ({packages})"
    )


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    # Not the bare name that `system` gives too.
    return f"{platform.machine()} processor"
