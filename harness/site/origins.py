"""Where a page's numbers come from: day, machine and versions of each study, in words."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from polhode.harness.common.machine import dates
from polhode.harness.site.sources import StudyRecords

# How the line of a folder's page begins that tells machine or versions.
TELLING = ("Measured ", "Machine: ", "Made by ")


def origins(folder: Path, studies: Iterable[StudyRecords]) -> tuple[str, ...]:
    """When, on which machine and with which versions each study was measured, a sentence for each folder.

    Parameters
    ----------
    folder : Path
        Folder of the reports.
    studies : iterable of StudyRecords
    """
    return tuple(dict.fromkeys(_origin(folder, study) for study in studies))


def _origin(folder: Path, study: StudyRecords) -> str:
    place = study.name.partition("/")[0]
    found = machines(study)
    if not found:
        return told(folder / place)
    return f"{place}: measured {dates(study.records)} on {found} ({packages(study)})."


def told(folder: Path) -> str:
    """What a folder's own page says of machine and versions; where to look, if it says nothing."""
    page = folder / "README.md"
    lines = page.read_text(encoding="utf-8").splitlines() if page.is_file() else []
    found = next((line for line in lines if line.startswith(TELLING) and "numpy" in line), None)
    return f"{folder.name}: " + (found[0].lower() + found[1:] if found else f"see reports/{folder.name}/README.md.")


def commands(folder: Path, studies: Iterable[StudyRecords]) -> tuple[str, ...]:
    """The commands that made studies, as the pages of their folders tell; none of those that do not tell.

    Parameters
    ----------
    folder : Path
        Folder of the reports.
    studies : iterable of StudyRecords
    """
    pages = dict.fromkeys(folder / study.name.partition("/")[0] / "README.md" for study in studies)
    texts = (page.read_text(encoding="utf-8") for page in pages if page.is_file())
    return tuple(dict.fromkeys(found[1] for text in texts if (found := re.search(r"\bMade by `([^`\n]+)`", text))))


def machines(study: StudyRecords) -> str:
    """Machines of a study's runs; empty if its records do not tell."""
    return _all(_machine(record["machine"]) for record in study.records if isinstance(record.get("machine"), dict))


def packages(study: StudyRecords) -> str:
    """Versions that a study's runs were made with; empty if its records do not tell."""
    return _all(_versions(record["versions"]) for record in study.records if isinstance(record.get("versions"), dict))


def _all(texts: Iterable[str]) -> str:
    return "; ".join(sorted(set(texts)))


def _machine(content: dict[str, Any]) -> str:
    names = ("processor", "cores", "system", "python")
    processor, cores, system, python = (content.get(name, "?") for name in names)
    return f"{processor}, {cores} cores, {system}, Python {python}"


def _versions(content: dict[str, Any]) -> str:
    return ", ".join(f"{name} {number}" for name, number in content.items())
