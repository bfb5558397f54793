"""What the committed pages say first is what their committed data say; an installed package has neither."""

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from runpy import run_path
from shutil import copytree
from subprocess import CalledProcessError, run
from types import SimpleNamespace
from typing import Any

import click
import pandas as pd
import pytest
from PIL import Image

from polhode.harness.analysis.frames import frame
from polhode.harness.analysis.pareto import costs
from polhode.harness.answers.averaging_laws import LAWS_FILE
from polhode.harness.answers.rules import HYBRID_LEAST_ERROR
from polhode.harness.averaging.data import SecondOrderStudy, read_study
from polhode.harness.averaging.hybrid import Study as HybridStudy
from polhode.harness.averaging.laws import laws_of
from polhode.harness.averaging.orders import slopes
from polhode.harness.averaging.random_study import read_data
from polhode.harness.averaging.shares import (
    HYBRID,
    LEAST_BODIES,
    at,
    form_seconds,
    full_seconds,
    kinds_in,
)
from polhode.harness.cli import polhode
from polhode.harness.common.machine import makers_of
from polhode.harness.common.store import read_export, record_file
from polhode.harness.pages import ensembles, equal_error, flows, problems, stiff
from polhode.harness.pages.averaging import hybrid, random_bodies, second_order
from polhode.harness.pages.bench import averaged_costs, verdict
from polhode.harness.pages.known_stokes import write_page
from polhode.harness.pages.outcomes import limit, sentences
from polhode.harness.pages.pick import rewrite_page, summary
from polhode.harness.pages.regimes import MAP_ERRORS, read_cells, sentence
from polhode.harness.paper import claims, store
from polhode.harness.paper.pages import write_pages
from polhode.harness.studies.cost import FirstRun, Overhead
from polhode.harness.studies.study import read_study as read_study_file
from polhode.models.catalogue import FORMS
from polhode.solvers.catalogue import SOLVERS

ROOT = Path(__file__).parents[1]
REPORTS = ROOT / "reports"
NUMBERS = {3: "three", 10: "ten", 11: "eleven", 12: "twelve", 20: "twenty"}

# Bytes of all committed pages, figures and data: what readers need; commands make the rest.
MOST_BYTES = 20_000_000

pytestmark = pytest.mark.skipif(not REPORTS.is_dir(), reason="no committed pages here")


def test_reports_are_small():
    listed = run(
        ["git", "ls-files", "-z", "reports"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("no clone of git")
    files = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert sum(path.stat().st_size for path in files if path.is_file()) <= MOST_BYTES


def records(page: str) -> pd.DataFrame:
    return frame(read_export(record_file(REPORTS / page)))


def bench() -> Iterable[str]:
    runs = records("bench")
    return [*verdict(runs), *averaged_costs(runs)]


def hard_cases() -> Iterable[str]:
    folder = REPORTS / "hard-cases"
    endings: Any = pd.read_csv(folder / "outcomes.csv", keep_default_na=False).to_dict("records")
    return sentences(endings, limit(records("hard-cases")))


def regimes() -> Iterable[str]:
    maps = read_cells(REPORTS / "regimes" / "cells.csv")
    return [
        f"The {name}, {sentence(found, MAP_ERRORS[error][0])}"
        for (name, error), found in maps.items()
    ]


def pick() -> Iterable[str]:
    return summary(pd.read_csv(REPORTS / "pick" / "scenes.csv"))


def sweep() -> Iterable[str]:
    """How each ensemble ends, and when half of it has arrived, from the fractions arrived by each time."""
    yield "0 of 12000 particles failed."
    arrivals = pd.read_csv(REPORTS / "sweep" / "arrivals.csv")
    for axes, same in arrivals.groupby(["a", "b", "c"], sort=False):
        ends = []
        for stokes, mine in same.groupby("stokes", sort=False):
            table = mine.pivot_table(index="time", columns="attractor", values="fraction")
            shares = [
                f"{100 * share:.4g} % rotate about the {name}"
                for name, share in table.iloc[-1].items()
            ]
            half = table.index[table.sum(axis="columns") >= 0.5][0]
            ends.append(f"at St = {stokes:g}, {', '.join(shares)}, half of all by t = {half:g}")
        yield f"{' : '.join(f'{axis:g}' for axis in axes)}, in the end: {'; '.join(ends)}."


PAGES: dict[str, Callable[[], Iterable[str]]] = {
    "bench/README.md": bench,
    "hard-cases/README.md": hard_cases,
    "regimes/README.md": regimes,
    "pick/README.md": pick,
    "sweep/README.md": sweep,
}


def text(page: str) -> str:
    return (REPORTS / page).read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES)
def test_first_lines_follow_from_the_data(page: str):
    before = text(page).split("\n![")[0].split("\n|")[0].split("\n## Against")[0]
    said = [line.removeprefix("- ") for line in before.splitlines() if line.startswith("- ")]
    # Scenes that were not taken have no row.
    assert [line for line in said if not line.startswith("Other scenes were drawn")] == list(
        PAGES[page]()
    )


def test_what_ensembles_cost_follows_from_the_data():
    assert text("sweep/throughput.md") == ensembles.page(json.loads(text("sweep/throughput.json")))


def test_pages_on_averaging_follow_from_the_data():
    second = read_study(SecondOrderStudy, REPORTS / "second-order")
    command = "polhode accuracy"
    made = {
        "accuracy": random_bodies.page(read_data(REPORTS / "accuracy"), command),
        "second-order": second_order.page(second, slopes(second.orders), f"{command} --order 2"),
        "hybrid": hybrid.page(
            read_study(HybridStudy, REPORTS / "hybrid"), f"{command} --order hybrid"
        ),
    }
    assert {name: text(f"{name}/README.md") for name in made} == made


def test_solve_pick_and_sweeps_use_the_laws_of_the_committed_study():
    laws = json.loads(LAWS_FILE.read_text(encoding="utf-8"))
    assert laws == laws_of(read_data(REPORTS / "accuracy"))
    assert json.loads(text("accuracy/laws.json")) == laws
    for name, measured in laws["measured"].items():
        assert measured["bodies"] >= LEAST_BODIES
        # Nothing is extrapolated faster than errors were seen to fall.
        assert laws["exponents"][name] >= measured["low"] - 0.02


def test_the_readme_says_which_form_when_as_the_study_found():
    laws = json.loads(LAWS_FILE.read_text(encoding="utf-8"))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert random_bodies.which_form(laws) in readme


def test_hybrid_is_not_tried_at_a_stokes_number_where_it_is_slower():
    stokes = 1e4
    assert 1e-6 * stokes**2 < HYBRID_LEAST_ERROR
    data = read_data(REPORTS / "accuracy")
    runs = at(data, 1.0)
    for kind in kinds_in(runs):
        full = full_seconds(data, kind, 1e-6)[stokes]
        assert form_seconds(runs, kind, HYBRID, 1e-6)[stokes] > full


def test_the_page_of_solvers_that_know_stokes_follows_from_the_data(tmp_path: Path):
    study, folder = ROOT / "harness" / "studies" / "known_stokes.toml", REPORTS / "known-stokes"
    copytree(folder, tmp_path / "copy")
    command = "polhode bench harness/studies/known_stokes.toml"
    page = write_page(
        read_study_file(study),
        list(read_export(record_file(folder))),
        tmp_path / "copy",
        command,
    )
    assert page.read_text(encoding="utf-8") == text("known-stokes/README.md")


def test_the_page_of_the_stiff_side_follows_from_the_data(tmp_path: Path):
    study = read_study_file(ROOT / "harness" / "studies" / "stiff.toml")
    records = list(read_export(record_file(REPORTS / "stiff")))
    page = stiff.write_page(study, records, tmp_path, "polhode bench harness/studies/stiff.toml")
    assert page.read_text(encoding="utf-8") == text("stiff/README.md")


def test_pages_on_the_paper_follow_from_the_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # Which code made the data is not the question here.
    monkeypatch.setattr(store, "content_key", lambda item, grid: "")
    names = [path.name for path in (REPORTS / "paper").glob("*.md")]
    for section in claims.sections():
        (tmp_path / section.name).symlink_to(REPORTS / "paper" / section.name)
    write_pages(tmp_path, claims.sections())
    for name in names:
        made = re.sub("Made by older code.*\n\n", "", (tmp_path / name).read_text(encoding="utf-8"))
        assert made == text(f"paper/{name}"), name


def test_the_page_of_linear_flows_follows_from_the_data():
    assert text("flows/README.md") == flows.page(REPORTS / "flows", "polhode flows")


def test_linear_flows_reach_what_they_are_to():
    found = flows.read_tables(REPORTS / "flows")
    assert found["fields"]["apart"].max() < 1e-14
    ratios = found["costs"].set_index(["form", "solver"])["ratio"]
    for (_, solver), ratio in ratios.items():
        assert ratio < (1.5 if solver == "taylor" else 1.2)
    assert found["orbits"]["apart"].max() < 1e-10
    knots = found["knots"].set_index("solver")["knot_us"]
    assert knots[["cyrk-vern8", "cyrk-dop853", "cyrk-tsit5", "taylor"]].max() < 20
    counts = flows.bounded(found["stated"])
    assert counts[["slow", "angle"]].sum().min() >= 0.975 * counts["runs"].sum()


def test_the_page_of_the_classical_problems_follows_from_the_data(tmp_path: Path):
    said = text("problems/README.md")
    copytree(REPORTS / "problems", tmp_path / "copy")
    assert problems.rewrite_page(tmp_path / "copy").read_text(encoding="utf-8") == said


def test_the_page_of_pick_follows_from_the_data(tmp_path: Path):
    copytree(REPORTS / "pick", tmp_path / "copy")
    page = rewrite_page(tmp_path / "copy")
    assert page.read_text(encoding="utf-8") == text("pick/README.md")


def docs_program(name: str) -> Any:
    """A program that writes a page from the reports."""
    return SimpleNamespace(**run_path(str(ROOT / "docs" / f"{name}.py")))


ALL_PAGES = sorted(path.relative_to(REPORTS).as_posix() for path in REPORTS.glob("*/*.md"))


@pytest.mark.parametrize("page", ALL_PAGES)
def test_each_page_names_in_one_form_what_measured_it(page: str):
    said = text(page)
    assert len(re.findall("^Measured (?:on|from) ", said, re.MULTILINE)) == 1
    line = re.search("^Measured .*", said, re.MULTILINE)
    makers = makers_of(said)
    assert line
    assert line[0].count("polhode ") == len(makers) >= 1


def test_the_front_page_says_which_commits_measured_the_pages():
    """Else `python docs/measured.py` is due."""
    front = text("README.md")
    assert front == docs_program("measured").page()
    makers = {maker for page in ALL_PAGES for maker in makers_of(text(page))}
    for maker in makers:
        assert str(maker) in front
    first = next(iter(makers))
    same = len(makers) == 1 and bool(first.version and first.commit)
    assert ("The pages were not all measured by one commit" in front) is not same


@pytest.mark.parametrize(
    "line", (REPORTS / "commands.txt").read_text("utf-8").splitlines() if REPORTS.is_dir() else []
)
def test_what_makes_everything_is_understood(line: str):
    name, *words = line.split()
    if "/" in name:
        assert (ROOT / name).is_file()
        return
    context = click.Context(polhode)
    command = polhode.get_command(context, name)
    assert command
    command.make_context(name, words, parent=context)


def test_cold_starts_become_a_page_like_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    program = run_path(str(ROOT / "tests" / "benchmarks" / "cold_start.py"))
    write = program["write"]
    monkeypatch.setitem(write.__globals__, "FOLDER", tmp_path)
    write([["`polhode --help`", "0.06", "0.05"], ["`polhode solve paper`", "0.33", "0.32"]])
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert "- `polhode solve paper` takes 0.33 s, which is the longest of 2." in page
    assert len(makers_of(page)) == 1
    rows = (tmp_path / "seconds.csv").read_text(encoding="utf-8").splitlines()
    assert rows == [
        "command,wall,processor",
        "`polhode --help`,0.06,0.05",
        "`polhode solve paper`,0.33,0.32",
    ]


def test_what_changed_since_0_1_follows_from_reports_and_history():
    """Else `python docs/since.py` is due."""
    program = docs_program("since")
    try:
        program.before("README.md")
    except (OSError, CalledProcessError):
        pytest.skip("no clone with the history of 0.1")
    said = program.PAGE.read_text(encoding="utf-8")
    for part in ("time_to_an_answer", "stated_errors", "cold_start", "throughput", "sources"):
        assert "\n".join(getattr(program, part)()) in said, part
    # Lines change with every commit.
    tables = [said[said.index(program.LINES) :], "\n".join(program.lines_of_code())]
    counts = [
        re.findall(r"^\| (\w+) +\| +(\d+) .*\| +(\d+) \| +\d+ \|$", table, re.MULTILINE)
        for table in tables
    ]
    assert len(counts[0]) == len(counts[1]) == 6
    for (part, old, new), (_, old_now, new_now) in zip(*counts, strict=True):
        assert old == old_now
        assert int(new) == pytest.approx(int(new_now), rel=0.1), part


FOLDED = sorted(
    path.relative_to(REPORTS).as_posix()
    for path in REPORTS.glob("*/*.md")
    if path.parent.name != "paper"
)


@pytest.mark.parametrize("page", FOLDED)
def test_pages_answer_first_and_say_at_the_foot_how_they_were_made(page: str):
    said = text(page)
    first = next(line for line in said.splitlines()[1:] if line)
    assert not first.startswith(("Made by", "Measured"))
    made = said.index("Made by `")
    assert made > said.rindex("<summary>")
    assert said.rstrip().endswith("</details>")
    if "![" in said and "\n|" in said:
        assert said.index("![") < said.index("\n|"), "the figure before the table"


@pytest.mark.parametrize(
    "picture", sorted(path.relative_to(REPORTS).as_posix() for path in REPORTS.glob("*/*.png"))
)
def test_pictures_are_as_wide_as_a_page(picture: str):
    with Image.open(REPORTS / picture) as image:
        assert image.width == 838


def test_the_pages_of_solvers_at_equal_error_follow_from_the_data():
    folder = REPORTS / "solvers"
    found = {
        name: list(read_export(record_file(folder, name)))
        for name in ("solvers", "spheroid", "backends")
    }
    costs: Any = json.loads(text("solvers/costs.json"))
    costs["overheads"] = [Overhead(**each) for each in costs["overheads"]]
    costs["first_runs"] = {
        name: [FirstRun(**each) for each in pair] for name, pair in costs["first_runs"].items()
    }
    made = equal_error.pages(equal_error.Measured(**found, **costs), "polhode equal-error")
    assert made == {name: text(f"solvers/{name}") for name in ("README.md", "times.md")}


def test_the_draft_of_the_paper_has_the_numbers_of_the_reports():
    """Else `python docs/paper_numbers.py` is due."""
    program = docs_program("paper_numbers")
    assert program.PAPER.read_text(encoding="utf-8") == program.paper()


def test_each_number_of_the_draft_is_read_from_a_report():
    program = docs_program("paper_numbers")
    template = program.TEMPLATE.read_text(encoding="utf-8")
    assert set(re.findall(r"\$(\w+)", template)) == set(program.numbers())


def test_a_number_that_a_report_says_no_more_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    program = docs_program("paper_numbers")
    monkeypatch.setitem(program.SAYINGS, "docs/threads.md", ("(?P<items>a number of nothing)",))
    assert program.main() == 1
    said = capsys.readouterr().err
    assert said == "docs/threads.md: does not say any more '(?P<items>a number of nothing)'\n"


def test_readme_says_what_there_is():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert (
        f" runs {NUMBERS[len(FORMS)]} forms of the equations by {NUMBERS[len(SOLVERS)]} solvers"
        in readme
    )
    own = [name for name in SOLVERS if SOLVERS.find(name).family == "polhode"]
    assert f" and {NUMBERS[len(own)]} of its own " in readme


def test_readme_says_what_was_found_on_the_paper():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    paper = re.search(r"\n(\d+ items: [^.]*)\.", text("paper/README.md"))
    assert paper
    assert paper[1] in readme


def fastest_of_the_ellipsoid(
    stokes: float, want: str, error: float, form: str = "quaternion", implicit: bool | None = None
) -> float:
    """Least seconds to an error, as the map interpolates them; by solvers of both sorts, or of one."""
    runs = pd.read_csv(REPORTS / "regimes" / "runs.csv")
    runs = runs[(runs.scene_name == "ellipsoid") & (runs.stokes == stokes)]
    seconds = costs([("ellipsoid", runs)], [error], want).iloc[0]
    return min(
        float(time)
        for (ran, solver), time in seconds.dropna().items()
        if ran == form and implicit in (None, SOLVERS.find(solver).implicit)
    )


def found_on_the_map(pattern: str) -> list[float]:
    """The numbers of a sentence of the README on the map."""
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    said = re.search(pattern, readme)
    assert said, f"the README does not say any more {pattern!r}"
    return [float(number) for number in said.groups()]


def in_two_digits(value: float) -> float:
    return float(f"{value:.2g}")


def test_readme_says_how_slow_explicit_solvers_are_where_the_equations_are_stiff():
    stokes, said, error = found_on_the_map(
        r"At St = (\S+) the fastest explicit one takes (\S+) times .*? to (\S+) rad\."
    )
    explicit = fastest_of_the_ellipsoid(stokes, "orientation_error", error, implicit=False)
    implicit = fastest_of_the_ellipsoid(stokes, "orientation_error", error, implicit=True)
    assert said == in_two_digits(explicit / implicit)


def test_readme_says_how_little_explicit_solvers_differ():
    first, last, said = found_on_the_map(
        r"from St = (\S+) to (\S+) the best one is (\S+) times as fast as the next, in the median"
    )
    cells = pd.read_csv(REPORTS / "regimes" / "cells.csv")
    cells = cells[(cells.scene == "ellipsoid") & (cells.error == "orientation_error")]
    cells = cells[cells.St.between(first, last)].dropna(subset=["form"])
    assert not any(SOLVERS.find(name).implicit for name in cells.solver)
    assert said == in_two_digits(cells.lead.median())


def test_readme_says_how_much_averaging_gains():
    error, stokes, said = found_on_the_map(
        r"for L and E to (\S+) at St = (\S+) the full equations take (\S+) times as long as averages"
    )
    full = fastest_of_the_ellipsoid(stokes, "slow_error", error)
    assert said == in_two_digits(
        full / fastest_of_the_ellipsoid(stokes, "slow_error", error, "averaged")
    )
    error, stokes, said = found_on_the_map(
        r"For the orientation to (\S+) rad at St = (\S+) they take (\S+) times as long as `hybrid`"
    )
    full = fastest_of_the_ellipsoid(stokes, "orientation_error", error)
    by_hybrid = fastest_of_the_ellipsoid(stokes, "orientation_error", error, "hybrid")
    assert said == in_two_digits(full / by_hybrid)


def said_of_implicit_methods() -> tuple[float, float]:
    """The St up to which implicit methods win at every error, and the one up to which at loose ones."""
    every, loose = found_on_the_map(
        r"implicit methods win at every error up to St = (\S+), at loose ones up to St = (\S+)\."
    )
    return every, loose


def test_implicit_solvers_win_at_small_stokes_numbers_as_the_readme_says():
    every, loose = said_of_implicit_methods()
    cells: Any = pd.read_csv(REPORTS / "regimes" / "cells.csv").dropna(subset=["form"])
    # Averaged forms, at large St, are no matter of stiffness.
    cells = cells[~cells["form"].map(lambda name: FORMS.find(name).averaged).astype(bool)]
    implicit = cells["solver"].map(lambda name: SOLVERS.find(name).implicit)
    assert implicit[cells["St"] <= every].all()
    assert cells["St"][implicit].max() == loose
    # At that St explicit ones win at the tightest errors.
    for _, column in cells[cells["St"] == loose].groupby(["scene", "error"]):
        assert not implicit[column["target"].idxmin()]


def test_each_winner_on_the_map_has_a_run_that_meets_the_error():
    cells = pd.read_csv(REPORTS / "regimes" / "cells.csv").dropna(subset=["form"])
    runs = pd.read_csv(REPORTS / "regimes" / "runs.csv")
    runs = runs[runs.status == "reached_end"]
    key = ["scene_name", "stokes", "form", "solver"]
    for cell in cells.itertuples():
        theirs = runs[(runs[key] == [cell.scene, cell.St, cell.form, cell.solver]).all(axis=1)]
        assert theirs[cell.error].min() <= cell.target, cell


def test_readme_says_how_long_the_runs_of_the_map_last():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    said = re.search(
        r"last (\S+) shear times up to St = (\S+), then .*? = (\d\.\d+)(?:; only at (\S+) it is (\S+), for)?",
        readme,
    )
    assert said, "the caption of the map has changed"
    shear, until, slow, far, short = (float(number or "nan") for number in said.groups())
    runs = pd.read_csv(REPORTS / "regimes" / "runs.csv")
    for stokes, time in runs.groupby("stokes")["scene.time"].unique().items():
        expected = shear if stokes <= until else stokes * (short if stokes == far else slow)
        assert time.tolist() == [pytest.approx(expected)], stokes


def test_readme_says_up_to_which_stokes_number_implicit_methods_win():
    cells = [
        cell for found in read_cells(REPORTS / "regimes" / "cells.csv").values() for cell in found
    ]
    won = [
        (cell.stokes, cell.target, cell.winner.side == "implicit") for cell in cells if cell.winner
    ]
    theirs, others = (
        {stokes for stokes, _, implicit in won if implicit == who} for who in (True, False)
    )
    assert (max(theirs - others), max(theirs)) == said_of_implicit_methods()
    last = [
        {target for stokes, target, implicit in won if (stokes, implicit) == (max(theirs), who)}
        for who in (True, False)
    ]
    assert min(last[0]) >= max(last[1])


def on(page: str, pattern: str) -> float:
    """The sum of the numbers that a pattern finds on a page."""
    found = re.search(pattern, text(page))
    assert found, pattern
    return sum(map(float, found.groups()))


def spheroid_axis_share() -> float:
    """Share in % of the cells of the spheroid's map that its own form wins."""
    maps = read_cells(REPORTS / "regimes" / "cells.csv")
    won = [
        cell.winner.form
        for (name, _), found in maps.items()
        for cell in found
        if name == "spheroid" and cell.winner
    ]
    return 100 * won.count("spheroid-axis") / len(won)


def error_of_most_bodies() -> float:
    """Error of first-order averaging that 97.5 % of the bodies of `polhode accuracy` stay below, times St."""
    return json.loads(text("accuracy/laws.json"))["most"]["first order"]


def cost(pattern: str) -> Callable[[], float]:
    return lambda: on("solvers/README.md", pattern)


def pinch(pattern: str) -> Callable[[], float]:
    return lambda: on("paper/clocks.md", pattern)


def runs_of_the_map() -> float:
    return len(pd.read_csv(REPORTS / "regimes" / "runs.csv"))


FIRST_RUN = r"(?s)What a first run costs.*?\| {} +\| +\S+ [mµ]s \| +(\S+) ms"
METHOD, MISPRINTS = "docs/method.md", "docs/misprints.md"
# Sentences that rest on a page, what that says now, and how far apart they may be, in parts of the
# latter.
SAID = [
    (METHOD, r"some (\S+) ms with a field", cost(FIRST_RUN.format("cyrk-vern8")), 0.3),
    (METHOD, r"(\S+) with its exact Jacobian", cost(FIRST_RUN.format("cvode-bdf")), 0.3),
    (METHOD, r"(\S+) with heyoka's integrator", cost(FIRST_RUN.format("taylor")), 0.3),
    (METHOD, r"about (\S+) µs in plain Python", cost(r"(\S+) µs \(plain Python\)"), 0.3),
    (METHOD, r"(\S+) ns compiled but called", cost(r"(\S+) ns \(compiled, called"), 0.3),
    (METHOD, r"(\S+) ns in machine code alone", cost(r"(\S+) ns \(alone\)"), 0.3),
    (METHOD, r"wins about (\S+) % of the cells", spheroid_axis_share, 0.15),
    (MISPRINTS, r"κ = 1.2: abs L ∝ St\^(\S+) ", pinch(r"κ = 1.2 +\| (\S+)"), 0.01),
    (MISPRINTS, r"for κ < (\S+) alone", pinch(r"κ > (\d\.\d+)"), 0.001),
    ("docs/scaling.md", r"if (\S+)/St is below the tolerance", error_of_most_bodies, 0.01),
    ("harness/commands/words.md", r"is some (\S+) runs and", runs_of_the_map, 0.05),
]
# Sentences that say how long a command takes, and the page whose head says in how many minutes its
# runs were made.
LASTED = [
    ("README.md", r"\((\S+) minutes on 2 cores\)", "bench/README.md"),
    ("harness/commands/words.md", r"takes some (\S+) minutes: references", "regimes/README.md"),
    ("harness/commands/words.md", r"About (\S+) minutes; an interrupted", "solvers/README.md"),
]


@pytest.mark.parametrize(("file", "sentence", "found", "within"), SAID)
def test_docs_say_what_the_pages_say(
    file: str, sentence: str, found: Callable[[], float], within: float
):
    said = re.search(sentence, " ".join((ROOT / file).read_text(encoding="utf-8").split()))
    assert said, sentence
    assert float(said[1].replace("−", "-")) == pytest.approx(found(), rel=within)


@pytest.mark.parametrize(("file", "sentence", "page"), LASTED)
def test_docs_say_how_long_commands_took(file: str, sentence: str, page: str):
    said = re.search(sentence, " ".join((ROOT / file).read_text(encoding="utf-8").split()))
    assert said, sentence
    # References before the first run and pages after the last one come in addition.
    took = on(page, r"timed runs, made in (\d+) minutes")
    assert 0.8 * took <= float(said[1]) <= 2 * took + 1
