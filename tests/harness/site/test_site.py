"""The site: it says what the reports say, names what is missing, and loads nothing from elsewhere."""

import re
import tracemalloc
from contextlib import redirect_stderr
from dataclasses import replace
from html import unescape
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from commandline import Run, small_disk
from PIL import Image, ImageColor, ImageDraw
from sites import TAG, data_of, pages_of, site

import polhode
from polhode.harness.common.files import dumps
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import export, read_export
from polhode.harness.common.text import duration
from polhode.harness.pages.figures.style import looks
from polhode.harness.pages.regimes import read_cells
from polhode.harness.site import sources
from polhode.harness.site.answers import NEEDED, RUN_NUMBERS, read_studies
from polhode.harness.site.build import DOCS
from polhode.harness.site.markup import Page, html, plain, prose, section
from polhode.harness.site.motion import examples, motion
from polhode.harness.site.sources import REPORT_COMMANDS
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS

ROOT = Path(__file__).parents[3]
REPORTS = ROOT / "reports"
OWN = "reports/own/README"
PAGES = ("index", "cost", "reports/regimes/README", "reports/hard-cases/README", OWN, "motion")


def test_what_is_missing_is_named_with_its_command(tmp_path: Path):
    pages = site(tmp_path / "site", tmp_path / "reports")
    assert set(pages) == {"index", "cost", "motion", "search"}
    for command in REPORT_COMMANDS.values():
        assert re.search(rf">to make:|; to make: .*{re.escape(command.split()[1])}", pages["index"])
    assert "to make: <code>polhode bench</code>" in pages["cost"]


def test_a_page_that_another_version_or_other_code_measured_says_so_in_red(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(sources, "versions", lambda: {"polhode": "0.2.0"})
    monkeypatch.setattr(sources, "code_digest", lambda: "a" * 12)
    made_by = {"old": "0.1.0", "next": "0.2.1.dev0", "before": "0.2.0.dev0", "new": "0.2.0"}
    texts = {
        name: f"# Page\n\nMeasured on 2026-01-01 on a machine (numpy 2.4.6, polhode {version}).\n"
        for name, version in made_by.items()
    }
    record = {"versions": {"polhode": "0.2.0"}}
    records_by_page = {
        "today": [{**record, "code": "a" * 12}],
        "other": [{**record, "code": "a" * 12}, {**record, "code": "b" * 12}],
        # Today's code under the name of an earlier version.
        "renamed": [{"versions": {"polhode": "0.1.0"}, "code": "a" * 12}],
    }
    for name, records in records_by_page.items():
        texts[name] = "\n".join(["# Page", "", *provenance("polhode bench", records)])
    reports = tmp_path / "reports"
    for name, text in texts.items():
        (reports / name).mkdir(parents=True)
        (reports / name / "README.md").write_text(text, encoding="utf-8")
    pages = site(tmp_path / "site", reports)
    for name in ("old", "next", "before"):
        warning = f'<p class="outdated">Measured by polhode {made_by[name]}, not by today'
        assert warning in pages[f"reports/{name}/README"]
    # Today's code names itself on the page.
    warning = '<p class="outdated">Measured by earlier code of polhode 0.2.0: numbers may differ.'
    assert warning in pages["reports/new/README"]
    red = f'<p class="outdated">Measured by other code ({"b" * 12}) than today'
    assert red in pages["reports/other/README"]
    for name in ("today", "renamed"):
        assert "outdated" not in pages[f"reports/{name}/README"]


def test_a_page_warns_by_each_version_that_measured_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sources, "versions", lambda: {"polhode": "0.2.0"})
    records = [{"versions": {"polhode": version}} for version in ("0.1.0", "0.2.0")]
    warned = sources._outdated("\n".join(provenance("", [*records, {}])))
    assert "Measured by polhode 0.1.0 and of an unknown version, not by today's 0.2.0" in warned
    earlier = sources._outdated("\n".join(provenance("", records[1:])))
    assert "Measured by earlier code of polhode 0.2.0: numbers may differ." in earlier


def links_of(page: str) -> set[str]:
    """Addresses that a page loads or leads to."""
    return {unescape(link) for link in re.findall(r'(?:src|href|action)="([^"]*)"', page)}


def dead_links(folder: Path) -> list[str]:
    """Links of a site's pages to a file, or a place on a page, that it does not have."""
    pages = pages_of(folder)
    places = {
        (folder / f"{name}.html").resolve(): set(re.findall(r'\bid="([^"]*)"', page))
        for name, page in pages.items()
    }
    dead = []
    for name, page in pages.items():
        for link in links_of(page):
            target, _, place = link.partition("#")
            if re.match(r"https?:|data:", link):
                continue
            target = target.partition("?")[0]
            file = (folder / name).parent / target if target else folder / f"{name}.html"
            # What stands after the hash with an = is a script's: a question, or a choice of runs.
            there = "=" in place or place in {"", *places.get(file.resolve(), ())}
            if not (file.is_file() and there):
                dead.append(f"{name}: {link}")
    return dead


def test_every_link_leads_somewhere(site_folder: Path):
    assert dead_links(site_folder) == []


@pytest.mark.parametrize("name", PAGES)
def test_pages_load_nothing_from_elsewhere(site_pages: dict[str, str], name: str):
    page = site_pages[name]
    loaded = re.findall(r'<(?:script|img|link|iframe)\b[^>]*?(?:src|href)="([^"]*)"', page)
    assert [link for link in loaded if re.match(r"https?:|//", link)] == []
    assert "@import" not in page
    assert "url(" not in page.replace("url(#", "")
    questions = {link for link in links_of(page) if link.startswith("#particle=")}
    runs = {link for link in links_of(page) if "cost.html#scene=hard-cases:" in link}
    assert bool(questions) == (name == "index")
    assert bool(runs) == (name == "reports/hard-cases/README")


@pytest.mark.parametrize("name", PAGES)
def test_every_page_has_the_navigation_in_its_groups(site_pages: dict[str, str], name: str):
    _, _, tree = site_pages[name].partition('<div class="sidebar-tree">')
    tree, _, _ = tree.partition("</aside>")
    captions = re.findall(r'<span class="caption-text">(.*?)</span>', tree)
    assert captions == ["What to run", "Evidence", "Physics"]
    groups = re.split(r'<span class="caption-text">', tree)[1:]
    listed = [re.findall(r">([^<>]+)</a>", group) for group in groups]
    assert listed[0] == ["What should I run?", "Cost of every run"]
    assert {"Map", "Hard cases", "Own"} <= {*listed[1]}
    # A page below another.
    assert ("More" in listed[1]) == (name == OWN)
    assert listed[2] == ["See it move"]
    (current,) = re.findall(r'<a class="current reference" href="#">([^<]*)</a>', tree)
    assert current in {name for group in listed for name in group}


def test_markdown_becomes_a_page(site_pages: dict[str, str]):
    page = site_pages[OWN]
    assert "<title>My own &lt;study&gt; - polhode</title>" in page
    assert re.search(r"<h1>My <code class=.literal.>own</code> &lt;study&gt;<a", page)
    assert '<section id="lx-of-1">' in page
    assert "<h2>L<sub>x</sub> of 1<a" in page
    assert "Text of 170 &lt; I<sub>max</sub>, <a" in page
    assert re.search(r'<a [^>]*href="more.html">more</a>', page)
    assert "<span>data</span> and " in page
    assert re.search(r'<img alt="A picture" src="../../_images/drawn.webp" */>', page)
    assert "<p>Nowhere</p>" in page
    assert '<td class="text-right">1.0e-9</td>' in page
    assert 'href="README.html#lx-of-1"' in site_pages["reports/own/more"]


def test_formulas_are_set_without_a_script(site_pages: dict[str, str]):
    page = site_pages[OWN]
    assert re.search(r'<math [^>]*display="inline">.*?<msqrt>.*?</math>:', page)
    assert re.search(r'<math [^>]*display="block">.*?<mfrac><mn>1</mn><mn>2</mn></mfrac>', page)
    assert "mathjax" not in "".join(links_of(page)).lower()


def test_the_search_knows_words_and_no_numbers(site_folder: Path):
    index = (site_folder / "searchindex.js").read_text(encoding="utf-8")
    _, _, terms = index.partition('"terms":{')
    assert '"particl":' in terms
    assert not re.search(r'[{,]"?\d[\d.e-]*"?:', terms.partition("}")[0])


def test_a_section_ends_where_the_next_begins():
    text = "# A\n\n## Verdict\n\n- one\n\n### Below\n\n- two\n"
    assert section(text, "Verdict").strip() == "- one"
    assert section(text, "Else") == ""


def test_data_in_a_page_cannot_end_its_script():
    page = html("interactive", page=Page("X", "", "", {"key": "</script><!--"}))
    assert '"\\u003c/script>\\u003c!--"' in page
    assert data_of(page, "key") == "</script><!--"


def rows_of(page: str) -> list[dict]:
    """Rows of the page of costs, words in their places, with study and St."""
    data = data_of(page, "cost-data")
    columns = [
        [one for each in own for one in ([each[0]] * each[1] if isinstance(each, list) else [each])]
        for own in data["columns"].values()
    ]
    rows = [dict(zip(data["columns"], row, strict=True)) for row in zip(*columns, strict=True)]
    for row in rows:
        row["study"], _, row["stokes"], row["tags"] = data["groups"][row["group"]]
        named = ("form", "solver", "status", "message", "tolerance")
        row |= {name: data["words"][row[name]] for name in named}
    return rows


def test_every_run_is_a_point_and_a_stopped_one_too(site_pages: dict[str, str], site_reports: Path):
    records = list(read_export(site_reports / "bench" / "records.jsonl.gz"))
    bench = [row for row in rows_of(site_pages["cost"]) if row["study"] == "bench"]
    assert len(bench) == len(records)
    key = ("stokes", "form", "solver", "tolerance")
    found = {tuple(row[name] for name in key): (row["slow_error"], row["seconds"]) for row in bench}
    for record in records:
        place = record["scene"]["stokes"], record["form"], record["solver"], record["tolerance"]
        assert found[place] == (plain(record["slow_error"]), plain(record["seconds"]))
    (stopped,) = [row for row in bench if row["status"] == "time_limit"]
    assert (stopped["message"], stopped["seconds"]) == ("stopped by hand", None)
    assert {tag for row in rows_of(site_pages["cost"]) for tag in row["tags"]} == {TAG}


def test_lines_join_runs_in_the_order_of_their_tolerances(tmp_path: Path, site_reports: Path):
    (tmp_path / "reports" / "bench").mkdir(parents=True)
    records = list(read_export(site_reports / "bench" / "records.jsonl.gz"))
    export(
        sorted(records, key=lambda record: record["seconds"] or 0),
        tmp_path / "reports" / "bench" / "records.jsonl",
    )
    lines: dict[tuple, list[float]] = {}
    for row in rows_of(site(tmp_path / "site", tmp_path / "reports")["cost"]):
        lines.setdefault((row["group"], row["form"], row["solver"]), []).append(row["tolerance"])
    assert all(line == sorted(line, reverse=True) for line in lines.values())
    assert all(len(line) == 3 for line in lines.values())


def test_looks_are_those_of_the_figures(site_pages: dict[str, str]):
    solvers = data_of(site_pages["cost"], "cost-data")["solvers"]
    for name, look in looks(solvers).items():
        assert (solvers[name]["color"], solvers[name]["mark"]) == (look.both, look.outline)


def test_the_map_shows_the_cells_of_the_report(site_pages: dict[str, str], site_reports: Path):
    cells = [
        cell for own in read_cells(site_reports / "regimes" / "cells.csv").values() for cell in own
    ]
    titles = [
        f"{cell.winner}: {duration(cell.seconds)}; next: {cell.second or 'none'}"
        for cell in cells
        if cell.winner
    ]
    assert sorted(re.findall(r'<td style="[^"]*" title="([^"]*)"', site_pages["index"])) == sorted(
        titles
    )


SHOWN = {**examples(), "rest-50": named_scene("rest-50")}


@pytest.mark.parametrize("name", SHOWN)
def test_motions_are_of_unit_vectors_and_start_on_their_paths(name: str):
    scene = SHOWN[name]
    found = motion(scene)
    axis, momentum = np.reshape(found["axis"], (-1, 3)), np.reshape(found["L"], (-1, 3))
    assert len(axis) == len(momentum) == found["samples"]
    assert found["time"] == scene.time
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1, atol=2e-4)
    if found["rows"]:
        rows = np.reshape(found["rows"], (-1, 2, 3))
        np.testing.assert_allclose(
            np.einsum("nij,nkj->nik", rows, rows),
            np.broadcast_to(np.eye(2), (len(rows), 2, 2)),
            atol=3e-3,
        )
        third = np.cross(rows[:, 0], rows[:, 1])
        np.testing.assert_allclose(
            np.stack([*np.moveaxis(rows, 1, 0), third], axis=1)[:, found["pole"]], axis, atol=3e-3
        )
    else:
        assert found["symmetry"] == found["pole"]
    angles = [float(angle) for angle in re.findall(r"([\d.]+)°", found["says"])]
    if found["rows"] is None:
        shown = np.degrees(np.arccos(np.abs(axis[[0, -1], 2])))
        np.testing.assert_allclose(angles, shown, atol=0.6)
    assert f"In {scene.time:g} shear times" in found["says"]
    moving = np.linalg.norm(momentum, axis=1) > 0
    np.testing.assert_allclose(np.linalg.norm(momentum[moving], axis=1), 1, atol=2e-4)
    moments = np.linspace(0, len(axis) - 1, len(found["paths"])).astype(int)
    for k, path in zip(moments, found["paths"], strict=True):
        np.testing.assert_allclose(np.reshape(path, (-1, 3))[0], axis[k], atol=2e-3)


def test_no_motion_of_a_sphere():
    assert motion(replace(named_scene("sphere"), time=1.0)) == {"why": "a sphere has no axis"}


def test_memory_holds_no_more_of_a_record_than_the_page_shows(tmp_path: Path, site_reports: Path):
    *_, record = read_export(site_reports / "bench" / "records.jsonl.gz")
    record["text"] = "x" * 100_000
    (tmp_path / "bench").mkdir()
    export([record] * 40, tmp_path / "bench" / "records.jsonl")
    read_studies(tmp_path, RUN_NUMBERS)
    tracemalloc.start()
    studies, _ = read_studies(tmp_path, RUN_NUMBERS)
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()
    assert studies["bench"]["seconds"].tolist() == [record["seconds"]] * 40
    assert set(studies["bench"]) <= {*RUN_NUMBERS, *NEEDED}


@pytest.fixture
def no_docs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sites without documentation, as where polhode is installed."""
    monkeypatch.setattr("polhode.harness.site.build.DOCS", Path("none"))


@pytest.mark.usefixtures("no_docs")
def test_a_full_disk_is_named_and_leaves_no_half_page(
    here: Run, site_reports: Path, tmp_path: Path
):
    with small_disk(tmp_path / "full", "500k") as folder:
        done = here("report", "--reports", site_reports, "--out", folder)
        assert done.returncode == 1
        assert re.fullmatch(
            rf"polhode: {folder}/\S+: No space left on device, expected a place to write and room for it\n",
            done.stderr,
        )
        pages = list(folder.rglob("*.html"))
        assert pages
        assert all(path.read_text(encoding="utf-8").endswith("</html>") for path in pages)


def test_docs_and_reports_are_one_small_site_with_the_api_and_no_dead_link(tmp_path: Path):
    """The site of the committed pages; in one test, so that one worker alone builds it."""
    if not REPORTS.is_dir():
        pytest.skip("no committed pages here")
    whole_site = tmp_path / "whole"
    complaints = StringIO()
    with redirect_stderr(complaints):
        site(whole_site, REPORTS, DOCS)
    assert complaints.getvalue() == ""
    pages = pages_of(whole_site)
    there = {
        path.relative_to(ROOT).with_suffix("").as_posix()
        for path in ROOT.glob("docs/*.md")
        if path.stem != "paper_template"
    }
    there |= {
        path.relative_to(ROOT).with_suffix("").as_posix()
        for path in [REPORTS / "README.md", *REPORTS.glob("*/*.md")]
    }
    assert set(pages) == there | {"index", "cost", "motion", "search"}
    assert dead_links(whole_site) == []
    # From docs to reports and back.
    assert any("../reports/" in link for link in links_of(pages["docs/second-order"]))
    assert "../../docs/second-order.html" in links_of(pages["reports/hybrid/README"])
    # It is small, and holds no more than it shows.
    files = {
        path.resolve(): path.stat().st_size for path in whole_site.rglob("*") if path.is_file()
    }
    assert sum(files.values()) < 5_000_000
    shown = {
        ((whole_site / name).parent / link.partition("#")[0].partition("?")[0]).resolve()
        for name, page in pages.items()
        for link in links_of(page)
    }
    assert set(files) <= shown
    # The API has the names that users import.
    for name in set(polhode.__all__) - {"__version__"}:
        assert f'id="polhode.{name}"' in pages["docs/api"], name


def test_pages_of_docs_and_reports_link_to_files_that_are_there():
    lost = []
    for page in [*ROOT.glob("docs/*.md"), *REPORTS.glob("*/*.md")]:
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        targets = re.findall(r"\]\((?!https?:)([^)#\s]+)[^)]*\)", text)
        lost += [(page.name, target) for target in targets if not (page.parent / target).exists()]
    assert lost == []


def test_pictures_keep_the_colours_of_their_lines(tmp_path: Path):
    lines = [look.colour for look in looks(SOLVERS).values()]
    image = Image.new("RGB", (1200, 300), "white")
    pen = ImageDraw.Draw(image)
    for i, colour in enumerate(lines):
        pen.line((0, 20 + 4 * i, 1200, 30 + 4 * i), fill=colour, width=2)
    # A picture's shading has more colours than a palette.
    image.paste(Image.linear_gradient("L").convert("RGB"), (900, 20))
    (tmp_path / "own").mkdir()
    image.save(tmp_path / "own" / "drawn.png")
    (tmp_path / "own" / "README.md").write_text("![Lines](drawn.png)\n", encoding="utf-8")
    site(tmp_path / "site", tmp_path)
    with Image.open(tmp_path / "site" / "_images" / "drawn.webp") as copied:
        shown = copied.convert("RGB")
    for i, colour in enumerate(lines):
        found, asked = shown.getpixel((0, 20 + 4 * i)), ImageColor.getrgb(colour)
        assert max(abs(a - b) for a, b in zip(found, asked, strict=True)) <= 20, colour


def test_a_report_takes_no_page_of_the_sites_own(tmp_path: Path):
    own = ("index", "cost", "motion")
    for name in own:
        (tmp_path / name).mkdir()
        (tmp_path / name / "README.md").write_text("# Mine\n", encoding="utf-8")
    pages = site(tmp_path / "site", tmp_path)
    mine = {name for name, page in pages.items() if "<h1>Mine<" in page}
    assert mine == {f"reports/{name}/README" for name in own}


def test_damaged_files_are_named(tmp_path: Path):
    broken = tmp_path / "reports"
    bare = dumps(dict.fromkeys(set(NEEDED) - {"stokes"}, "1"))
    texts = {
        "torn": '{"form": "quat',
        "other": '{"answer": 42}\n',
        "bare": bare,
        "problems-quick": "",
    }
    for name, text in texts.items():
        (broken / name).mkdir(parents=True)
        (broken / name / "records.jsonl").write_text(text, encoding="utf-8")
    studies, unreadable = read_studies(broken, ())
    assert studies == {}
    assert [Path(line.split(":")[0]).parent.name for line in unreadable] == [
        "bare",
        "other",
        "torn",
    ]


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("to 3e-07 at St = 1e+06", "to <span class=n>3e-7</span> at St = <span class=n>1e6</span>"),
        ("1.7e+02, -1.5e-09", "170, <span class=n>-1.5e-9</span>"),
        ("1.234e+02", "<span class=n>1.234e2</span>"),
        ("St^-1.98 to St^2.01.", "St<sup>-1.98</sup> to St<sup>2.01</sup>."),
        ("O(St^-1/2), St^(-0.549)", "O(St<sup>-1/2</sup>), St<sup>-0.549</sup>"),
        (
            "L_z0/I_max, L_xy of St* and I_e",
            "L<sub>z0</sub>/I<sub>max</sub>, L<sub>xy</sub> of St* and I<sub>e</sub>",
        ),
        ("8πX_c, 2I_e", "8πX<sub>c</sub>, 2I<sub>e</sub>"),
        ("rest-5e4, cyrk-vern8", "rest-5e4, cyrk-vern8"),
        ("Lx of 1/St^p is new", "L<sub>x</sub> of 1/St<sup>p</sup> is new"),
        (
            "`a*b*c^2 1e-06` on 2031-02-03",
            "<code>a*b*c^2 1e-06</code> on <span class=n>2031-02-03</span>",
        ),
    ],
)
def test_notation(text: str, html: str):
    assert prose(text) == html


def test_text_is_escaped():
    assert prose("a < b & `c_1` of I_max") == "a &lt; b &amp; <code>c_1</code> of I<sub>max</sub>"


@pytest.mark.usefixtures("no_docs")
def test_command_shows_a_scene_of_ones_own(here: Run, scene_file: Path, tmp_path: Path):
    done = here("report", "--scene", scene_file.name, "--out", "site", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip() == str(Path("site") / "index.html")
    motions = data_of(
        (tmp_path / "site" / "motion.html").read_text(encoding="utf-8"), "motion-data"
    )
    assert [each["name"] for each in motions] == [scene_file.name, *examples()]
    assert not list((tmp_path / "site").glob("*.partial"))


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (
            ("--scene", "papre"),
            "scene: got 'papre' (did you mean 'paper'?), expected a file or one of paper",
        ),
        (("--reports", "reprots"), "--reports: got 'reprots', expected an existing folder"),
    ],
)
def test_command_refuses_what_is_not_there(
    here: Run, tmp_path: Path, words: tuple[str, str], complaint: str
):
    done = here("report", *words)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert list(tmp_path.iterdir()) == []
