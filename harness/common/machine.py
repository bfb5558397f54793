"""Which machine, versions, commit, code and day a number came from, and the lines of a page that say so."""

import os
import platform
import re
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from polhode.harness.common.code_digest import code_digest
from polhode.harness.common.text import percent
from polhode.harness.common.timing import MAX_SENTINEL_RATIO, MIN_PROCESSOR_SHARE, disturbance
from polhode.models.libraries import version_of

# Packages whose versions pages name: those whose numbers a page shows, and those that make it.
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
# Folders and files of a clone whose changes change numbers: changes of others, such as reports, do not count.
# Files that git does not know yet are not looked at, the digest of the code has them.
_CODE = ("models", "solvers", "harness", "polhode", "pyproject.toml", "constraints.txt")
_CHANGED = " with changes"
# Hexadecimal digits that name a commit on a page. An estimate: among 1,000,000 commits another one begins
# with the same digits with a chance of 1 in 70,000. Git writes more where they do not tell commits apart.
_DIGITS_OF_A_COMMIT = 9
# Seconds after which git is given up, as on a file system that hangs. An estimate: it takes milliseconds.
_GIT_SECONDS = 60
_UNKNOWN_VERSION = "of an unknown version"
_NOT_KEPT = "not kept"
# The text that `Maker` writes. Git's short names have 7 digits at least, whole ones 40.
_MAKER = re.compile(
    rf"polhode (\d[\w.+]*|{_UNKNOWN_VERSION}), commit ([0-9a-f]{{7,40}}(?:{_CHANGED})?|{_NOT_KEPT})"
    r"(?:, code ([0-9a-f]+))?,"
)
# Said on every page that a command writes.
OVERWRITTEN = "Do not edit: the next run overwrites this page."
# Seconds between two records beyond which a study stood still, as when it was interrupted and
# resumed. Such a pause does not count as time that the study took. An estimate: with twice
# as much, stops of up to 20 minutes would count.
_PAUSE = 600.0
# Minutes from which on a page says how long its study took; rounded, this is the first plural.
_LEAST_MINUTES = 1.5


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


@cache
def commit() -> str | None:
    """The commit of the clone that polhode runs from, " with changes" if code was changed since; None without a clone.

    Git is asked once in a process, when something is measured.
    """
    clone = Path(__file__).resolve().parents[2]
    if not (clone / ".git").exists():
        return None
    name = _git(clone, "rev-parse", f"--short={_DIGITS_OF_A_COMMIT}", "HEAD")
    if not name:
        return None
    changed = _git(clone, "status", "--porcelain", "--untracked-files=no", "--", *_CODE)
    return name + _CHANGED * bool(changed)


def _git(clone: Path, *words: str) -> str:
    """The output of git; empty if git fails, hangs for `_GIT_SECONDS`, or is not installed."""
    try:
        done = subprocess.run(
            ["git", *words],
            cwd=clone,
            capture_output=True,
            text=True,
            check=True,
            timeout=_GIT_SECONDS,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def surroundings() -> dict[str, Any]:
    """Machine, versions, commit and digest of the code of a measurement."""
    return {
        "machine": machine(),
        "versions": versions(),
        "commit": commit(),
        "code": code_digest(),
    }


def surroundings_of(record: Mapping[str, Any]) -> dict[str, Any]:
    """Machine, versions and commit of a record, and its code if it names one: earlier records do not."""
    names = ["machine", "versions", "commit"]
    if record.get("code"):
        names.append("code")
    return {name: record.get(name) for name in names}


def here(**more: Any) -> dict[str, Any]:
    """Date, machine, versions, commit and digest of the code of a measurement."""
    return {"date": now(), **surroundings(), **more}


def provenance(command: str, records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines that say how a page was made: by which command, when, on which machines, with which versions and commits.

    Where no record has a date or a machine, the line says that it is unknown. A digest is left out if there is none.
    """
    machines = dict.fromkeys(_place(record) for record in records if "machine" in record)
    makers = dict.fromkeys(map(_maker, records)) or [Maker("", "")]
    by = " and ".join(f"{maker}," for maker in makers)
    where = f"on {' and '.join(machines)}" if machines else "on an unknown machine"
    disturbed, judged = disturbance(records)
    rule = (
        f"had the processor for less than {percent(MIN_PROCESSOR_SHARE)} of its time, "
        f"or the machine took {MAX_SENTINEL_RATIO:g} × its shortest"
    )
    runs = f"{judged} timed runs{_took(records)}"
    said = (
        f" Disturbed by other work: {disturbed} of {runs} (the fastest {rule})." if judged else ""
    )
    return [made_by(command), "", f"Measured {dates(records)} by {by} {where}.{said}", ""]


def made_by(command: str) -> str:
    """The sentences of a page that say which command writes it."""
    return f"Made by `{command}`. {OVERWRITTEN}"


def made_lines(page: Path) -> list[str]:
    """The lines of a page that say by which command and where it was made, to be kept when it is written anew.

    Raises ValueError if there are none.
    """
    lines = page.read_text(encoding="utf-8").split("\n") if page.is_file() else []
    kept_lines = [line for line in lines if line.startswith(("Made by `", "Measured "))]
    if not kept_lines:
        raise ValueError(f"{page}: no such file, expected a page of `polhode`")
    return [part for line in kept_lines for part in (line, "")]


class Maker(NamedTuple):
    """The version, the commit and the digest of the code that measured a page; each empty if it was not kept."""

    version: str
    commit: str
    code: str = ""

    def __str__(self) -> str:
        """Version, commit and code as pages say them: `_MAKER` reads this."""
        version = self.version or _UNKNOWN_VERSION
        words = f"polhode {version}, commit {self.commit or _NOT_KEPT}"
        return f"{words}, code {self.code}" if self.code else words


def makers_of(text: str) -> list[Maker]:
    """The makers of a page, read from the line that `provenance` wrote; empty if the page has no such line."""
    line = re.search(r"^Measured (?:on|from) .*", text, re.MULTILINE)
    makers = []
    for version, name, code in _MAKER.findall(line[0] if line else ""):
        kept_version = version.replace(_UNKNOWN_VERSION, "")
        makers.append(Maker(kept_version, name.replace(_NOT_KEPT, ""), code))
    return makers


def versions_and_commits(makers: Sequence[Maker]) -> tuple[str, str]:
    """The versions and the commits of makers as two cells of a table, each with commas, once, and in their order."""
    versions = dict.fromkeys(maker.version or _NOT_KEPT for maker in makers)
    commits = dict.fromkeys(maker.commit or _NOT_KEPT for maker in makers)
    return ", ".join(versions), ", ".join(commits)


def dates(records: Sequence[Mapping[str, Any]]) -> str:
    """The day, or the first and the last one, on which records were measured; some may have no date."""
    # An ISO date begins with the ten characters of the day.
    days = sorted({record["date"][:10] for record in records if record.get("date")})
    if not days:
        return "on an unknown date"
    span = f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}"
    return (
        span if all(record.get("date") for record in records) else f"{span}, and on unknown dates"
    )


def _took(records: Sequence[Mapping[str, Any]]) -> str:
    """Words on the minutes from the first record to the last, pauses left out; empty below `_LEAST_MINUTES`."""
    # Some records name a day alone: its beginning stands for it.
    dates = [datetime.fromisoformat(record["date"]) for record in records if record.get("date")]
    times = sorted(date if date.tzinfo else date.replace(tzinfo=UTC) for date in dates)
    gaps = [(later - earlier).total_seconds() for earlier, later in pairwise(times)]
    minutes = sum(gap for gap in gaps if gap < _PAUSE) / 60
    return f", made in {minutes:.0f} minutes" if minutes >= _LEAST_MINUTES else ""


def _place(record: Mapping[str, Any]) -> str:
    """Machine and versions of a record, in words."""
    machine = record["machine"]
    versions = record["versions"].items()
    packages = ", ".join(f"{name} {number}" for name, number in versions if name != "polhode")
    place = "{processor}, {cores} cores, {system}, Python {python}".format(**machine)
    return f"{place} ({packages})" if packages else place


def _maker(record: Mapping[str, Any]) -> Maker:
    """Version, commit and code of a record."""
    version = record.get("versions", {}).get("polhode") or ""
    return Maker(version, record.get("commit") or "", record.get("code") or "")


def _processor() -> str:
    """The processor's name as Linux tells it; elsewhere its architecture."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    # `machine` gives the bare architecture already, as part of `system`.
    return f"{platform.machine()} processor"
