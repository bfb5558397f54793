"""The sources of the site: pages of docs and reports as they stand, and those that are made here."""

import re
import tomllib
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from io import BytesIO
from pathlib import Path

from PIL import Image

from polhode.harness.common.code_digest import code_digest
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import OVERWRITTEN, Maker, machine, makers_of, versions
from polhode.harness.pages.figures.style import few_colours
from polhode.harness.pages.tables import fill, templates
from polhode.harness.site.answers import QUESTION_TITLE, cost_page, question
from polhode.harness.site.markup import Page, html, section
from polhode.harness.site.motion import motion_page
from polhode.models.scene import Scene
from polhode.models.scenes import SCENES

_HERE = Path(__file__).parent
NAVIGATION = tomllib.loads((_HERE / "navigation.toml").read_text("utf-8"))
# By folder of the reports: the command that fills it.
REPORT_COMMANDS = tomllib.loads((_HERE / "commands.toml").read_text("utf-8"))
# Sections of the bench's page for the opening page: its heading there, and on the bench's page.
_SECTIONS = {"Robust or fast": "Robust or fast", "When averaging pays": "Verdict"}
# Names of the pictures of reports/bench whose content the page of costs shows, run by run.
_ON_COSTS = re.compile(r"(slow|orientation)(-[\w-]+)?\.png")
# Files that pages of docs link to and a reader wants to see or run.
_SHOWN_CODE = (".py", ".toml", ".ipynb")
# Pictures have few colours, which halve a file. Red, green and blue are multiples of 17, 16 values
# from 0 to 255 = 15 × 17, so that black and white stay what they are.
_ROUNDED = [round(value / 17) * 17 for value in range(256)]  # By each value from 0 to 255.
# How hard WebP looks for a smaller file of the same pixels: more takes longer and gains little. Estimates.
_EFFORT = 75  # From 0 to 100: "quality", as Pillow calls it for lossy pictures.
_METHOD = 3  # From 0 to 6.


def write_sources(
    reports: Path,
    docs: Path,
    scenes: dict[str, Scene],
    folder: Path,
    say: Callable[[str], None],
) -> None:
    """Write the sources into a folder, in which docs and reports stand beside each other as in a clone.

    Templates are left out: the pages that are filled from them stand beside them.

    Parameters
    ----------
    reports, docs
        Folders of the reports and of the documentation.
    scenes
        Scenes of the user by name.
    folder
        Where the sources go.
    say
        Receives a line for each page and motion.
    """
    files = {
        f"docs/{path.stem}": path
        for path in sorted(docs.glob("*.md"))
        if not path.stem.endswith("_template")
    }
    if (reports / "README.md").is_file():
        files["reports/README"] = reports / "README.md"
    files |= {
        f"reports/{path.parent.name}/{path.stem}": path for path in sorted(reports.glob("*/*.md"))
    }
    for name, path in files.items():
        say(name)
        text = path.read_text(encoding="utf-8")
        if name.startswith("reports/"):
            text = _report(name, text, [*files])
        else:
            _copy_code(text, path, folder / name)
        text = _copy_pictures(text, path, folder / name)
        write_file(folder / f"{name}.md", text)
    write_file(folder / "cost.md", _interactive(cost_page(reports)))
    write_file(folder / "motion.md", _interactive(motion_page(scenes, say)))
    write_file(folder / "index.md", _opening(reports, folder, [*files]))


def _opening(reports: Path, sources: Path, names: list[str]) -> str:
    """The opening page: the question, findings of the bench, and the navigation."""

    def text_of(folder: str) -> str:
        """The text of a report's page; empty if there is none."""
        path = sources / "reports" / folder / "README.md"
        return path.read_text(encoding="utf-8") if path.is_file() else ""

    # The answer of a page is the first item of its first list. That of the hard cases, who never failed,
    # stands beside the answer of the regime map, who is quickest.
    items = (line for line in text_of("hard-cases").splitlines() if line.startswith("- "))
    body, data = question(reports / "regimes", next(items, "").removeprefix("- "))
    page = Page(QUESTION_TITLE, fill("site-question"), body, data, ("verdict.js",))
    bench = text_of("bench")
    sections = {title: section(bench, heading) for title, heading in _SECTIONS.items()}
    return (
        templates(_HERE)
        .get_template("index.md")
        .render(
            title=QUESTION_TITLE,
            opening=_interactive(page, _outdated(text_of("regimes"))),
            # Links are relative to the bench's page.
            sections={
                title: re.sub(r"\]\((?!https?:|#)", "](reports/bench/", text)
                for title, text in sections.items()
                if text
            },
            lacking={
                folder: command
                for folder, command in REPORT_COMMANDS.items()
                if f"reports/{folder}/README" not in names
            },
            groups=_groups(names),
            today=datetime.now(UTC).date(),
            here=machine(),
            packages=versions(),
        )
    )


def _groups(names: list[str]) -> dict[str, dict[str, str]]:
    """By group the pages that there are, with their names in the navigation; `names` are those of docs and reports."""
    there = {*names, "cost", "motion"}
    groups = {
        caption: {page: name for page, name in pages.items() if page in there}
        for caption, pages in NAVIGATION.items()
    }
    listed = {page for pages in groups.values() for page in pages}
    # Pages beside a folder's README stand below it. All others that no group lists go into "Evidence".
    others = [
        name
        for name in names
        if name not in listed and (name.startswith("docs/") or name.endswith("/README"))
    ]
    groups["Evidence"] |= {name: name.split("/")[1].capitalize() for name in others}
    return groups


def _interactive(page: Page, above: str = "") -> str:
    """The Markdown of a page: its title, `above`, its sentence, then HTML with the data of its scripts."""
    body = html("interactive", page=page)
    return f"# {page.title}\n\n{above}{page.lead}\n\n``````{{raw}} html\n{body}\n``````\n"


def _report(name: str, text: str, names: list[str]) -> str:
    """The text of a report's page as the site shows it; `names` are the names of all pages."""
    text = text.replace(f" {OVERWRITTEN}", "")
    title, _, rest = text.partition("\n")
    text = f"{title}\n\n{_outdated(text)}{rest}"
    folder = name.removesuffix("/README")
    if name == "reports/hard-cases/README":
        text = re.sub(r"^\| ([\w-]+)(?= +\|)", _linked_to_runs, text, flags=re.MULTILINE)
    if folder == "reports":
        # The bold line on top says that pages were made by different code: `{.outdated}`, an attribute of
        # MyST, makes it red (`site.css`).
        return re.sub(r"^\*\*(.*)\*\*$", r"{.outdated}\n\1", text, count=1, flags=re.MULTILINE)
    if folder == name:
        return text
    beside = [other.rpartition("/")[2] for other in names if other.startswith(f"{folder}/")]
    beside.remove("README")
    if beside:
        entries = "\n".join(beside)
        text += f"\n```{{toctree}}\n:hidden:\n\n{entries}\n```\n"
    return text


def _outdated(text: str) -> str:
    """A warning above a page that other code than today's measured; empty if today's did.

    Pages say which code measured them since 0.2.0. One that names no code was measured by earlier code,
    and the warning says its version. A warning that stands in the text already is not read as a maker.
    """
    line = re.search(r"^Measured .*", text, re.MULTILINE)
    if line is None:
        return ""
    # Pages of 0.1 name the version among the libraries.
    makers = makers_of(text) or [
        Maker(version, "") for version in re.findall(r"\bpolhode (\d[\w.]*\w)", line[0])
    ]
    codes = dict.fromkeys(maker.code for maker in makers if maker.code)
    # The digest takes a second: it is not computed for pages that name none.
    other_codes = [code for code in codes if code != code_digest()]
    if other_codes:
        names = " and ".join(other_codes)
        said = f"Measured by other code ({names}) than today's ({code_digest()})"
        return f"{{.outdated}}\n{said}: numbers may differ.\n\n"
    measured = [maker.version for maker in makers if not maker.code]
    if not measured:
        return ""
    today = versions().get("polhode", "")
    others = [version for version in measured if version != today]
    names = " and ".join(dict.fromkeys(version or "of an unknown version" for version in others))
    said = (
        f"polhode {names}, not by today's {today}" if others else f"earlier code of polhode {today}"
    )
    return f"{{.outdated}}\nMeasured by {said}: numbers may differ.\n\n"


def _linked_to_runs(cell: re.Match[str]) -> str:
    """A hard case's name in a table leads to its runs: `cost.js` reads what follows "#", where + is a space."""
    if cell[1] not in SCENES:
        return cell[0]
    return f'| <a href="../../cost.html#scene=hard-cases:+{cell[1]}">{cell[1]}</a>'


def _copy_code(text: str, source: Path, page: Path) -> None:
    """Copy the code that a page links to."""
    for target in re.findall(r"\]\(([^)#\s]+)\)", text):
        path = source.parent / target
        if path.suffix in _SHOWN_CODE and path.is_file():
            write_file(page.parent / target, path.read_bytes())


def _copy_pictures(text: str, source: Path, page: Path) -> str:
    """Copy the pictures of a page, and return its text, in which they are WebP; of lost ones it has the words alone."""
    return re.sub(r"!\[([^\]]*)\]\(([^)\s]+)\)", partial(_picture, source, page), text)


def _picture(source: Path, page: Path, link: re.Match[str]) -> str:
    """Copy the picture of a link beside a page, as WebP; the new link, or its words if there is no such file."""
    words, target = link.groups()
    path = source.parent / target
    if not path.is_file():
        return words
    copied = BytesIO()
    with Image.open(path) as image:
        # One table for each of red, green and blue.
        drawn = few_colours(image.convert("RGB").point(_ROUNDED * 3)).convert("RGB")
    drawn.save(copied, "webp", lossless=True, quality=_EFFORT, method=_METHOD)
    name = Path(target).with_suffix(".webp").as_posix()
    write_file(page.parent / name, copied.getvalue())
    shown = f"![{words}]({name})"
    if source.parent.name == "bench" and _ON_COSTS.fullmatch(target):
        shown += "\n\n[As a diagram, run by run](../../cost.md)"
    return shown
