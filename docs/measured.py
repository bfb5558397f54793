"""Write `reports/README.md`: which version and commit of polhode measured each page, and how long each command took.

`python docs/measured.py` writes the page from the heads of the reports' pages and from
`reports/durations.csv`, which `make everything` leaves.
"""

import csv
import re
import shutil
from collections import Counter
from pathlib import Path

from polhode.harness.common.machine import Maker, made_by, makers_of, versions_and_commits
from polhode.harness.common.text import duration, markdown

ROOT = Path(__file__).parents[1]
REPORTS = ROOT / "reports"
PAGE = REPORTS / "README.md"
# Left by `make everything`: a row for each command that it began.
_LATEST_DURATIONS = ROOT / "build" / "everything" / "durations.csv"
_DURATIONS = REPORTS / "durations.csv"


def pages() -> list[Path]:
    """All pages of the reports."""
    return sorted(REPORTS.glob("*/*.md"))


def page() -> str:
    """The text of the page."""
    makers_by_page = {path: makers_of(path.read_text(encoding="utf-8")) for path in pages()}
    rows = [_row(path, makers) for path, makers in makers_by_page.items()]
    heads = ["page", "made by", "measured", "version", "commit"]
    lines = ["# What measured these pages", "", *_summary(makers_by_page), ""]
    lines += [markdown(heads, rows), *_durations()]
    lines += [made_by("python docs/measured.py")]
    return "\n".join(lines) + "\n"


def _summary(makers_by_page: dict[Path, list[Maker]]) -> list[str]:
    """By which commits pages were measured: how many pages by each, and the pages that several have measured."""
    total = len(makers_by_page)
    counts = Counter(makers[0] for makers in makers_by_page.values() if len(makers) == 1)
    if total in counts.values():
        (only,) = counts
        if only.version and only.commit:
            return [f"All {total} pages were measured by {only}."]
    lines = [f"- {maker}: {count} of {total} pages" for maker, count in sorted(counts.items())]
    for path, makers in makers_by_page.items():
        if len(makers) > 1:
            name = path.relative_to(REPORTS).as_posix()
            named = "; ".join(map(str, makers))
            lines.append(f"- [{name}]({name}) has data of {len(makers)} commits: {named}")
    return [
        "**The pages were not all measured by one commit: numbers of two pages may differ.**",
        "",
        *lines,
    ]


def _row(path: Path, makers: list[Maker]) -> list[str]:
    text = path.read_text(encoding="utf-8")
    name = path.relative_to(REPORTS).as_posix()
    command = re.search(r"^Made by `(.*?)`", text, re.MULTILINE)
    dates = re.search(r"^Measured (?:on )?(.*?) by polhode", text, re.MULTILINE)
    return [
        f"[{name}]({name})",
        f"`{command[1]}`" if command else "–",
        dates[1] if dates else "–",
        *_version_and_commit(makers),
    ]


def _version_and_commit(makers: list[Maker]) -> tuple[str, str]:
    """Cells of a page's row; `_summary` names the commits of a page that several have measured."""
    versions, commits = versions_and_commits(makers)
    return versions, commits if len(makers) == 1 else f"{len(makers)}, named above"


def _durations() -> list[str]:
    """How long each command took the last time that all were run, if that was kept."""
    if not _DURATIONS.is_file():
        return []
    with _DURATIONS.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    seconds: dict[str, float] = {}
    for row in rows:
        # An interrupted command has a row for each time that it was begun.
        seconds[row["command"]] = seconds.get(row["command"], 0.0) + float(row["seconds"])
    cells = [[f"`{command}`", duration(taken)] for command, taken in seconds.items()]
    cells.append(["in sum", duration(sum(seconds.values()))])
    return [
        "## How long each command took",
        "",
        markdown(["command", "time"], cells, right=(1,)),
    ]


def main() -> None:
    """Take the durations of a `make everything` under way, and write the page."""
    if _LATEST_DURATIONS.is_file():
        shutil.copyfile(_LATEST_DURATIONS, _DURATIONS)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
