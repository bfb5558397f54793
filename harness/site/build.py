"""Build the site: read what there is, make the pages, write them."""

from collections.abc import Callable
from datetime import UTC, datetime
from html import escape
from pathlib import Path

from polhode.harness.common.files import PartialFile
from polhode.harness.common.machine import machine, versions
from polhode.harness.site.about_page import about_page
from polhode.harness.site.accuracy_page import accuracy_page
from polhode.harness.site.cost import cost_page
from polhode.harness.site.hard_page import hard_page
from polhode.harness.site.laws_page import laws_page
from polhode.harness.site.markup import Page, document
from polhode.harness.site.motion import motion_page
from polhode.harness.site.paper_page import copy_figures, paper_page
from polhode.harness.site.sources import measured, read_sources
from polhode.harness.site.verdict_page import verdict_page
from polhode.models.scene import Scene

# Pages in the order of the menu, by name: what the menu calls them.
MENU = {
    "index": "Verdict",
    "cost": "Cost",
    "accuracy": "Averaging",
    "laws": "Laws",
    "hard": "Hard cases",
    "paper": "Paper",
    "motion": "Motion",
    "about": "About",
}


def build(reports: Path, out: Path, scenes: dict[str, Scene], tell: Callable[[str], None] = lambda _: None) -> Path:
    """Write the site and return its opening page.

    Parameters
    ----------
    reports : Path
        Folder of what the harness produced; whatever is missing there is named on the pages.
    out : Path
        Folder of the site.
    scenes : dict
        Scenes of one's own to show moving, by name.
    tell : callable
        Receives a line about what is being made.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    tell("reading")
    sources = read_sources(reports)
    makers: dict[str, Callable[[], Page]] = {
        "index": lambda: verdict_page(sources),
        "cost": lambda: cost_page(sources),
        "accuracy": lambda: accuracy_page(sources),
        "laws": lambda: laws_page(sources, tell),
        "hard": lambda: hard_page(sources),
        "paper": lambda: paper_page(sources),
        "motion": lambda: motion_page(scenes, tell),
        "about": lambda: about_page(sources),
    }
    foot = _foot(measured(sources.studies.values()))
    for name, make in makers.items():
        tell(MENU[name])
        with PartialFile(out / f"{name}.html") as file:
            file.write(document(make(), list(MENU.items()), foot))
    copy_figures(sources, out)
    return out / "index.html"


def _foot(when: str) -> str:
    here, packages = machine(), versions()
    libraries = ", ".join(f"{name} {number}" for name, number in packages.items())
    today = datetime.now(UTC).strftime("%Y-%m-%d")
    data = f"Data measured {when}. " if when else ""
    return escape(
        f"{data}Built on {today} by polhode report, {here['processor']}, {here['system']}, Python {here['python']}; "
        f"{libraries}."
    )
