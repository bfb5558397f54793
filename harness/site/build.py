"""Build the site: render the pages that the reports hold, add the interactive ones, write them."""

import re
import tomllib
from collections.abc import Callable
from datetime import UTC, datetime
from importlib import resources
from io import BytesIO
from pathlib import Path

from PIL import Image

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import machine, versions
from polhode.harness.pages.figures.style import few_colours
from polhode.harness.pages.tables import fill
from polhode.harness.site.answers import TITLE, cost_page, question
from polhode.harness.site.markup import (
    FIGURES,
    Page,
    document,
    html,
    page_name,
    prose,
    render,
    section,
)
from polhode.harness.site.motion import motion_page
from polhode.models.scene import Scene
from polhode.models.scenes import SCENES

# By folder of the reports: what the menu calls it, and the command that fills it.
REPORTS = tomllib.loads(Path(__file__).with_name("reports.toml").read_text("utf-8"))
# Sections of the bench's page for the opening page: its heading there, and on the bench's page.
_SECTIONS = {"Robust or fast": "Robust or fast", "When averaging pays": "Verdict"}
# The page of costs shows the content of these pictures.
_ON_COSTS = re.compile(r"(slow|orientation)(-[\w-]+)?\.png")


def build(
    reports: Path, out: Path, scenes: dict[str, Scene], say: Callable[[str], None] = lambda _: None
) -> Path:
    """Write the site, with scenes of one's own by name; returns its opening page; `say` receives a line about each."""
    overwritten = " Do not edit: the next run overwrites this page."
    files = {page_name(path): path for path in sorted(reports.glob("*/*.md"))}
    texts = {
        name: path.read_text(encoding="utf-8").replace(overwritten, "")
        for name, path in files.items()
    }
    addresses = {path.resolve(): f"{name}.html" for name, path in files.items()}
    rendered = {
        name: render(texts[name], path, addresses, _as_costs) for name, path in files.items()
    }
    folders = [
        name for name in [*REPORTS, *files] if name in rendered and files[name].stem == "README"
    ]
    menu = {name: REPORTS.get(name, (name.capitalize(), ""))[0] for name in dict.fromkeys(folders)}
    menu = {"index": "What to run", "cost": "Cost", **menu, "motion": "Motion"}
    (out / FIGURES).mkdir(parents=True, exist_ok=True)
    for file in resources.files("polhode.harness.site").iterdir():
        if file.name.endswith((".css", ".js")):
            write_file(out / file.name, file.read_bytes())
    foot = html("foot", today=datetime.now(UTC).date(), here=machine(), packages=versions())

    def write(name: str, page: Page) -> None:
        say(page.title)
        write_file(out / f"{name}.html", document(name, page, menu, foot))

    # The answer of a page is the first item of its first list.
    items = (line for line in texts.get("hard-cases", "").splitlines() if line.startswith("- "))
    asked, data = question(reports / "regimes", next(items, "").removeprefix("- "))
    # Who is robust, who is fast and when averaging pays, from the bench; what the reports lack.
    parts = {
        title: section(texts.get("bench", ""), heading) for title, heading in _SECTIONS.items()
    }
    sections = {
        title: render(text, files["bench"], addresses).body for title, text in parts.items() if text
    }
    lacking = {name: command for name, (_, command) in REPORTS.items() if name not in files}
    body = html("index", asked=asked, sections=sections, lacking=lacking)
    body = _made_by(texts.get("regimes", "")) + body
    write("index", Page(TITLE, fill("site-question"), body, data, ("tables.js", "verdict.js")))
    write("cost", cost_page(reports))
    write("motion", motion_page(scenes, say))
    for name, content in rendered.items():
        body = (
            re.sub(r"<td>([\w-]+)</td>", _runs_of, content.body)
            if name == "hard-cases"
            else content.body
        )
        beside = [
            neighbour
            for neighbour in rendered
            if neighbour.startswith(f"{name}-") and f'"{neighbour}.html' not in content.body
        ]
        links = ", ".join(
            f'<a href="{neighbour}.html">{prose(rendered[neighbour].title)}</a>'
            for neighbour in beside
        )
        body = f'<p class="note">Beside this page: {links}.</p>{body}' if links else body
        write(name, Page(content.title or name, "", _made_by(texts[name]) + body))
        for picture, path in content.pictures.items():
            # In few colours and a format that keeps the site small.
            copied = BytesIO()
            with Image.open(path) as image:
                drawn = few_colours(image.convert("RGB")).convert("RGB")
            drawn.save(copied, "webp", lossless=True, quality=50, method=2)
            write_file(out / FIGURES / picture, copied.getvalue())
    return out / "index.html"


def _made_by(text: str) -> str:
    """A warning above a page that another version than today's measured, by the page's own words."""
    found = re.search(r"^Measured .*?\bpolhode (\d[\w.]*)", text, re.MULTILINE)
    today = versions().get("polhode", "")
    if found is None or _release(found[1]) == _release(today):
        return ""
    words = f"Measured by polhode {found[1]}, not by today's {today}: numbers may differ."
    return f'<p class="outdated">{words}</p>'


def _release(version: str) -> str:
    """The release that a version under development leads to: 0.2.0 of 0.2.0.dev0."""
    return version.partition(".dev")[0]


def _runs_of(cell: re.Match[str]) -> str:
    """A hard case's name in a table leads to its runs."""
    if cell[1] not in SCENES:
        return cell[0]
    return f'<td><a href="cost.html#scene=hard-cases: {cell[1]}">{cell[1]}</a></td>'


def _as_costs(picture: str) -> str:
    return (
        '<p><a href="cost.html">As a diagram, run by run</a></p>'
        if _ON_COSTS.fullmatch(picture)
        else ""
    )
