"""The site: it says what the records say, names what is missing, and loads nothing from elsewhere."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commandline import STUDY, Run
from sites import C, data_of, site

from polhode.harness.analysis.outcomes import INACCURATE, limits, outcome, reasons, write_page
from polhode.harness.analysis.regime_map import cells
from polhode.harness.common.store import export
from polhode.harness.common.text import duration
from polhode.harness.pages.averaging import LAWS_HEADER
from polhode.harness.paper import store
from polhode.harness.paper.catalogue import sections
from polhode.harness.paper.item import Grid
from polhode.harness.picking.laws import load_laws
from polhode.harness.site.build import MENU
from polhode.harness.site.markup import bullets, plain, prose
from polhode.harness.site.motion import examples, motion
from polhode.harness.site.origins import told
from polhode.harness.site.sources import read_sources
from polhode.harness.site.verdict_page import tens
from polhode.harness.studies.study import parse_study
from polhode.models.scene_file import scene_table
from polhode.models.scenes import named_scene


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("bare")
    return site(folder / "site", folder / "reports")


COMMANDS = {
    "index": "polhode bench",
    "cost": "polhode bench",
    "accuracy": "polhode accuracy",
    "laws": "polhode validate",
    "hard": "polhode bench harness/studies/hard_cases.toml",
    "paper": "polhode paper",
}


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_missing_is_named_with_its_command(bare: dict[str, str], name: str):
    messages = re.findall(r'<p class="missing">.*?</p>', bare[name])
    assert any(f"to make: <code>{COMMANDS[name]}</code>" in message for message in messages)


def test_every_page_tells_when_its_data_were_measured(tmp_path: Path, site_reports: Path, bare: dict[str, str]):
    reports = tmp_path / "reports"
    for name, days in (("one", ("2031-02-03T04:05:06Z", "2031-02-04T00:00:00Z")), ("two", ("2031-02-03T23:59:59Z",))):
        (reports / name).mkdir(parents=True)
        records = [{**record, "date": days[-1]} for record in read_sources(site_reports).studies["bench"].records]
        records[0]["date"] = days[0]
        export(records, reports / name / "records.jsonl")
    pages = site(tmp_path / "site", reports)
    assert all("Data measured from 2031-02-03 to 2031-02-04." in page for page in pages.values())
    about = re.findall(r"<td>on (\S+)</td>|<td>from (\S+) to (\S+)</td>", plain_text(pages["about"]))
    lines = re.findall(r"<p class=note>one: measured (.*?) on ", plain_text(pages["cost"]))
    assert lines == ["from 2031-02-03 to 2031-02-04"]
    assert about == [("", "2031-02-03", "2031-02-04"), ("2031-02-03", "", "")]
    assert not any("Data measured" in page for page in bare.values())


def plain_text(page: str) -> str:
    """A page without the marks that keep a number on one line."""
    return re.sub(r"<span class=n>(.*?)</span>", r"\1", page)


def test_pages_name_the_machine_their_folder_tells(tmp_path: Path):
    (tmp_path / "README.md").write_text("# Title\n\nMade by `x`.\n\nMachine: A, Python 9; numpy 2.\n", encoding="utf-8")
    assert told(tmp_path) == f"{tmp_path.name}: machine: A, Python 9; numpy 2."
    assert told(tmp_path / "none") == "none: see reports/none/README.md."


def test_data_of_the_paper_that_other_code_left_are_named_as_missing(tmp_path: Path):
    section, item = next((section, item) for section in sections() for item in section.items)
    store.write(
        tmp_path / "reports" / "paper" / section.name, item, Grid.REDUCED, {"else": {"unknown": np.arange(3.0)}}
    )
    page = site(tmp_path / "site", tmp_path / "reports")["paper"]
    assert "to make: <code>polhode paper</code>" in page


@pytest.mark.parametrize("name", MENU)
def test_pages_load_nothing(site_pages: dict[str, str], bare: dict[str, str], name: str):
    for page in (site_pages[name], bare[name]):
        links = set(re.findall(r'(?:src|href|action)="([^"]*)"', page))
        local = {f"{other}.html" for other in MENU} | {"data:,", "#main"}
        within = {f"#{name}" for name in re.findall(r'id="([^"]*)"', page)}
        assert {link for link in links if not re.fullmatch(r"figures/[\w-]+\.png", link)} <= local | within
        assert set(re.findall(r"https?://[^\s\"']*", page)) <= {"http://www.w3.org/2000/svg"}
        assert "@import" not in page
        assert "url(" not in page.replace("url(#", "")
        assert "default-src 'none'" in page


@pytest.mark.parametrize("name", MENU)
def test_every_page_links_to_every_other(site_pages: dict[str, str], name: str):
    assert re.findall(r'<a href="(\w+)\.html" aria-current=page>', site_pages[name]) == [name]
    assert all(f'<a href="{other}.html"' in site_pages[name] for other in MENU)


def test_every_run_is_a_point_and_a_stopped_one_too(site_pages: dict[str, str], site_reports: Path):
    data = data_of(site_pages["cost"], "cost-data")
    records = [json.loads(line) for line in (site_reports / "bench" / "records.jsonl").read_text().splitlines()]
    bench = [row for row in data["rows"] if data["groups"][row[0]][0] == "bench"]
    column = data["columns"].index
    assert len(bench) == len(records)
    found = {
        (data["groups"][row[0]][2], *row[1:4]): (row[column("slow_error")], row[column("seconds")]) for row in bench
    }
    for record in records:
        key = record["scene"]["stokes"], record["form"], record["solver"], record["tolerance"]
        assert found[key] == (plain(record["slow_error"]), plain(record["seconds"]))
    (stopped,) = [row for row in bench if row[column("status")] == "time_limit"]
    assert stopped[column("message")] == "stopped by hand"
    assert stopped[column("seconds")] is None


def test_the_map_shows_the_winners(site_pages: dict[str, str], site_reports: Path):
    study = read_sources(site_reports).studies["regimes"]
    for error in ("slow_error", "orientation_error"):
        for cell in cells(study.table, error):
            if cell.winner is not None:
                assert f'title="{cell.winner}: {duration(cell.seconds)}; next' in site_pages["index"]


def test_averaging_does_not_pay_where_it_was_not_tried(site_pages: dict[str, str]):
    head, row = re.findall(r"<tr>(.*?)</tr>", site_pages["index"])[:2]
    assert "paper, semi-axes (1, 0.8, 0.5), St = 50 to 100" in head
    assert row == "<td>0.1</td><td>not tried</td>"


def test_averaging_that_does_not_pay_is_told_from_averaging_not_tried(tmp_path: Path, site_reports: Path):
    (tmp_path / "reports" / "bench").mkdir(parents=True)
    records = read_sources(site_reports).studies["bench"].records
    slow = [{**one, "form": "averaged", "seconds": 1e3} for one in records if one["scene"]["stokes"] == 100]
    export([*records, *slow], tmp_path / "reports" / "bench" / "records.jsonl")
    assert "<td>0.1</td><td>not up to St = 100</td>" in site(tmp_path / "site", tmp_path / "reports")["index"]


def test_commands_are_those_that_made_the_folders(tmp_path: Path, site_reports: Path):
    """A study file lies anywhere: only the folder's own page tells where."""
    records = read_sources(site_reports).studies["bench"].records
    for name in ("own", "bare"):
        (tmp_path / "reports" / name).mkdir(parents=True)
        export(list(records), tmp_path / "reports" / name / "records.jsonl")
    page = "# Own\n\nMade by `polhode bench docs/own_study.toml`. Do not edit.\n"
    (tmp_path / "reports" / "own" / "README.md").write_text(page, encoding="utf-8")
    made = site(tmp_path / "site", tmp_path / "reports")["cost"].partition('<section class="made">')[2]
    assert re.findall("<li><code>(.*?)</code>", made) == ["polhode bench docs/own_study.toml"]
    (tmp_path / "reports" / "own" / "README.md").unlink()
    made = site(tmp_path / "site", tmp_path / "reports")["cost"].partition('<section class="made">')[2]
    assert "Make it again" not in made
    assert "own: measured" in made


@pytest.mark.parametrize(
    ("value", "text"), [(1e-12, "10^−12"), (0.01, "0.01"), (1, "1"), (100.0, "100"), (1e4, "10^4"), (3e4, "3·10^4")]
)
def test_powers_of_ten(value: float, text: str):
    assert tens(value) == text


def test_accuracy_tells_order_and_st(site_pages: dict[str, str]):
    cells = re.findall(r"<td[^>]*>(.*?)</td>", site_pages["accuracy"])
    row = cells[cells.index("case") :][: len(LAWS_HEADER)]
    assert row[LAWS_HEADER.index("order")] == "1.00"
    # C / St = 1e-2
    assert float(row[LAWS_HEADER.index("St for 0.01")]) == pytest.approx(C / 1e-2, rel=0.01)


def test_laws_compare_every_timed_run(site_pages: dict[str, str], site_reports: Path):
    points = [point for series in data_of(site_pages["laws"], "laws-chart")["series"] for point in series["points"]]
    studies = read_sources(site_reports).studies
    records = [record for name in ("bench", "hard-cases") for record in studies[name].records]
    timed = [load_laws().pace.seconds(record) for record in records if record["seconds"]]
    assert sorted(point[1] for point in points) == pytest.approx(sorted(timed), rel=1e-5)
    assert all(point[0] > 0 for point in points)


def test_predictions_on_scenes_held_out_are_points(site_pages: dict[str, str]):
    for kind, place in (("seconds", (0.002, 0.001)), ("slow_error", (1e-7, 1e-8))):
        (series,) = data_of(site_pages["laws"], f"held-out-{kind}")["series"]
        assert [tuple(point[:2]) for point in series["points"]] == [place]
    verdict = "0.0% of 1 times were predicted within a factor 1.5 at the usual pace, 100.0% as timed."
    assert verdict in site_pages["laws"]


RUN = {"status": "reached_end", "seconds": 0.1, "solver_slow_error": 1e-9, "model_slow_error": 0.0, "message": ""}


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        ({}, "reached", "solver error 1.0e-9"),
        ({"model_slow_error": 0.5}, "reached", "the form itself is off by 5.0e-1"),
        ({"solver_slow_error": 0.1}, "inaccurate", "solver error 1.0e-1"),
        ({"solver_slow_error": None, "reference_failed": "no agreement"}, "unknown", "no agreement"),
        ({"status": "time_limit"}, "stopped", "time limit"),
        ({"status": "non_finite", "message": "at t = 3"}, "failed", "non finite: at t = 3"),
        ({"status": "something_new"}, "failed", "something new"),
    ],
)
def test_outcomes_of_hard_cases(change: dict, kind: str, words: str):
    found = outcome({**RUN, **change})
    assert found[0] == kind
    assert words in found[1]


def test_errors_of_a_fast_body_are_measured_against_it():
    """Ω = 1e3 makes L² and E large: the limit grows with the larger of them."""
    records = [{"scene_name": name, "scene": scene_table(named_scene(name))} for name in ("fast-spin", "rest-50")]
    allowed = limits(records)
    scene = named_scene("fast-spin")
    assert allowed["rest-50"] == INACCURATE
    assert allowed["fast-spin"] == pytest.approx(
        INACCURATE * float(scene.initial.energy[0]) / max(scene.ellipsoid.inertia)
    )
    run = {**RUN, "solver_slow_error": 10.0}
    assert outcome(run, allowed["fast-spin"])[0] == "reached"
    assert outcome(run, allowed["rest-50"])[0] == "inaccurate"


def test_hard_cases_show_every_outcome_with_its_reason(site_pages: dict[str, str], site_reports: Path):
    page = site_pages["hard"]
    records = read_sources(site_reports).studies["hard-cases"].records
    stopped = re.findall(r'<td class="stopped" title="([^"]*)"', page)
    assert any("time limit: stopped by hand" in reason for reason in stopped)
    assert page.count("✓</span>") + page.count("≈</span>") >= len({(r["form"], r["solver"]) for r in records}) - 1


def test_page_of_several_scenes_has_a_sign_for_every_run(tmp_path: Path, site_reports: Path):
    records = read_sources(site_reports).studies["hard-cases"].records
    study = parse_study(tomllib.loads(STUDY))
    page = write_page(study, records, tmp_path, "polhode bench several.toml").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ") and ("✓" in line or "≈" in line or "◷" in line)]
    signs = "".join(rows)
    assert sum(signs.count(sign) for sign in "✓≈◷✕") == len(records)
    assert signs.count("◷") == 1
    assert "time limit: stopped by hand" in page
    assert "## paper, St = 50, t = 1, tolerance 0.0001" in page
    assert len((tmp_path / "records.jsonl").read_text().splitlines()) == len(records)


def test_reasons_join_solvers_of_one_form():
    cells = {"a": ("failed", "why"), "b": ("reached", ""), "c": ("failed", "why"), "d": ("stopped", "late")}
    assert reasons({"form": cells}) == ["form, a, c: failed, why", "form, d: stopped, late"]


@pytest.mark.parametrize("name", examples())
def test_motions_are_of_unit_vectors_and_start_on_their_paths(name: str):
    scene = examples()[name]
    found = motion(scene)
    axis, momentum = np.reshape(found["axis"], (-1, 3)), np.reshape(found["L"], (-1, 3))
    assert len(axis) == len(momentum) == len(found["t"])
    assert found["t"][-1] == pytest.approx(scene.time)
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1, atol=2e-4)
    moving = np.linalg.norm(momentum, axis=1) > 0
    np.testing.assert_allclose(np.linalg.norm(momentum[moving], axis=1), 1, atol=2e-4)
    moments = np.linspace(0, len(axis) - 1, len(found["paths"])).astype(int)
    for k, path in zip(moments, found["paths"], strict=True):
        np.testing.assert_allclose(np.reshape(path, (-1, 3))[0], axis[k], atol=2e-3)


def test_no_motion_of_a_sphere():
    assert motion(replace(named_scene("sphere"), time=1.0)) == {"why": "a sphere has no axis"}


def test_damaged_files_are_named(tmp_path: Path, site_reports: Path):
    broken = tmp_path / "reports"
    for name, text in (("torn", '{"form": "quat'), ("other", '{"answer": 42}\n')):
        (broken / name).mkdir(parents=True)
        (broken / name / "records.jsonl").write_text(text, encoding="utf-8")
    unreadable = read_sources(broken).unreadable
    assert [Path(line.split(":")[0]).parent.name for line in unreadable] == ["other", "torn"]


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("to 3e-07 at St = 1e+06", "to <span class=n>3e-7</span> at St = <span class=n>1e6</span>"),
        ("1.7e+02, -1.5e-09", "170, <span class=n>-1.5e-9</span>"),
        ("1.234e+02", "<span class=n>1.234e2</span>"),
        ("O(St^-1/2), St^(-0.549)", "O(St<sup>-1/2</sup>), St<sup>-0.549</sup>"),
        ("L_z0/I_max, L_xy of St* and I_e", "L<sub>z0</sub>/I<sub>max</sub>, L<sub>xy</sub> of St* and I<sub>e</sub>"),
        ("rest-5e4, cyrk-vern8", "rest-5e4, cyrk-vern8"),
        ("Lx of 1/St^p is *new*", "L<sub>x</sub> of 1/St<sup>p</sup> is <em>new</em>"),
        ("`a*b*c^2 1e-06` on 2031-02-03", "<code>a*b*c^2 1e-06</code> on <span class=n>2031-02-03</span>"),
    ],
)
def test_notation(text: str, html: str):
    assert prose(text) == html


def test_text_is_escaped():
    assert bullets(["a < b & `c_1` of I_max"]) == "<ul><li>a &lt; b &amp; <code>c_1</code> of I<sub>max</sub></li></ul>"


def test_command_shows_a_scene_of_ones_own(polhode: Run, scene_file: Path, tmp_path: Path):
    done = polhode("report", "--scene", scene_file.name, "--out", "site", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip() == str(Path("site") / "index.html")
    motions = data_of((tmp_path / "site" / "motion.html").read_text(encoding="utf-8"), "motion-data")
    assert [each["name"] for each in motions] == [scene_file.name, *examples()]
    assert not list((tmp_path / "site").glob("*.partial"))


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--scene", "papre"), "scene: got 'papre', expected a file or one of paper"),
        (("--reports", "reprots"), "--reports: got 'reprots', expected an existing folder"),
    ],
)
def test_command_refuses_what_is_not_there(polhode: Run, tmp_path: Path, words: tuple[str, str], complaint: str):
    done = polhode("report", *words)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert list(tmp_path.iterdir()) == []
