"""Items of the reproduction: what is kept, what is made again, what the pages say, and the command itself."""

import json
import os
import signal
import subprocess
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from click.testing import CliRunner
from commandline import SCRIPT
from matplotlib.figure import Figure
from PIL import Image

from polhode.harness.commands.bench import paper
from polhode.harness.common.fits import mean_interval, median_interval, power_law
from polhode.harness.pages.figures.style import few_colours
from polhode.harness.paper import claims, store
from polhode.harness.paper.claims import find_items, section_of
from polhode.harness.paper.drawing import FIGURE_FORMATS
from polhode.harness.paper.item import Experiment, Grid, Item, Number, Range, Section, Verdict, Word
from polhode.harness.paper.pages import allowed, measured
from polhode.harness.paper.reproduction import run
from polhode.harness.paper.tables import groups

LARGEST_FIGURE = 300_000


@dataclass(frozen=True)
class MadeUp(Experiment):
    """A power law that counts how often it is computed."""

    calls: list = field(repr=False, compare=False)
    slope: float = -1.0
    failure: type[Exception] | None = field(default=None, repr=False)
    refusal: str = field(default="", repr=False)

    def compute(self, grid):
        self.calls.append(grid)
        x = np.geomspace(1.0, 1e4, 5)
        yield "", {"x": x, "y": x**self.slope, "word": "a,b"}
        if self.failure:
            raise self.failure("no such luck")

    def draw(self, data):
        figure = Figure()
        figure.subplots().plot(data[""]["x"], data[""]["y"])
        return figure

    def judge(self, data):
        if self.refusal:
            raise ValueError(self.refusal)
        slope = power_law(data[""]["x"], data[""]["y"])[0]
        number = Number("slope", slope, Range.near(-1.0, 1e-3, "made so"))
        return Verdict(Word.CONFIRMED, "It falls.", "A line.", [number])


def made_up(calls, slope=-1.0):
    return Item("made-up", "Made up", "nowhere", "It falls.", MadeUp(calls, slope))


def changed(item, **settings):
    return replace(item, experiment=replace(item.experiment, **settings))


@pytest.fixture
def catalogue(monkeypatch):
    """Let the engine believe that the catalogue holds one section with the given items."""

    def replace_by(*items):
        section = Section("made", "Made", items)
        monkeypatch.setattr(claims, "sections", lambda: (section,))

    return replace_by


def test_what_is_there_is_kept(tmp_path, catalogue):
    calls, told = [], []
    item = made_up(calls)
    catalogue(item)
    for _ in range(2):
        assert run([item], tmp_path, told.append, grid=Grid.REDUCED) == []
    assert calls == [Grid.REDUCED]
    assert "cached" in told[-2]


def test_items_side_by_side_say_when_they_begin_the_longest_first(tmp_path, monkeypatch):
    """Each process has one thread for linear algebra; the environment is as before when they are done."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    chosen = find_items(("euler-top", "symmetric-top"))
    monkeypatch.setattr(type(chosen[1].experiment), "seconds", 7.0)
    assert chosen[0].experiment.seconds < chosen[1].experiment.seconds
    lines = []
    during = []

    def note(line):
        lines.append(line.split()[0])
        during.append(os.environ["OPENBLAS_NUM_THREADS"])

    assert run(chosen, tmp_path, note, grid=Grid.REDUCED, processes=2) == []
    assert lines[1:3] == ["symmetric-top", "euler-top"]
    assert during[1] == "1"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"
    assert "MKL_NUM_THREADS" not in os.environ


def test_ctrl_c_in_the_command_alone_ends_its_processes_too(tmp_path):
    """The two items take a minute; nobody waits for them, and nothing of them is written afterwards."""
    words = [SCRIPT, "paper", "averaging-order", "poincare-slender", "--out", str(tmp_path)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as command:
        assert command.stderr
        begun = [command.stderr.readline().split()[0] for _ in range(3)]
        began = perf_counter()
        command.send_signal(signal.SIGINT)
        # The stream ends when no process holds it any more.
        said = command.stderr.read()
    assert begun[1:] == ["averaging-order", "poincare-slender"]
    assert command.returncode == 1
    assert said.endswith("polhode: interrupted\n")
    assert "Traceback" not in said
    assert perf_counter() - began < 20
    assert not list(tmp_path.rglob("*.csv"))


@pytest.mark.parametrize(
    "settings", [{"grid": Grid.FULL}, {"grid": Grid.REDUCED, "force": True}], ids=["grid", "force"]
)
def test_another_grid_and_force_compute_again(tmp_path, catalogue, settings):
    calls = []
    item = made_up(calls)
    catalogue(item)
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)
    run([item], tmp_path, lambda _: None, **settings)
    assert len(calls) == 2


def test_damaged_data_are_made_again(tmp_path, catalogue):
    calls = []
    item = made_up(calls)
    catalogue(item)
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)
    path = tmp_path / "made" / "made-up.csv"
    path.write_text(path.read_text().replace("1000", "1001"))
    assert store.read(tmp_path / "made", item) is None
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)
    assert len(calls) == 2


def test_redraw_takes_data_of_older_code(tmp_path, catalogue, monkeypatch):
    calls = []
    item = made_up(calls)
    catalogue(item)
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)
    monkeypatch.setattr(store, "ITEM_SCHEMA", store.ITEM_SCHEMA + 1)
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED, redraw=True)
    assert len(calls) == 1
    assert (
        "Made by older code, to be computed again: made-up" in (tmp_path / "README.md").read_text()
    )
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)
    assert len(calls) == 2


@pytest.mark.parametrize("kind", [RuntimeError, ValueError, IndexError])
def test_a_failure_does_not_stop_the_others(tmp_path, catalogue, kind):
    calls, told = [], []

    broken = replace(changed(made_up([]), failure=kind), name="broken", title="Broken")
    item = made_up(calls)
    catalogue(broken, item)
    assert run([broken, item], tmp_path, told.append, grid=Grid.REDUCED) == ["broken"]
    assert calls
    assert any("no such luck" in line for line in told)
    assert "Not computed yet: `polhode paper broken`" in (tmp_path / "made.md").read_text()


def test_a_failure_leaves_the_data_that_were_there(tmp_path, catalogue):
    item = made_up([])
    catalogue(item)
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)

    failing = changed(item, failure=RuntimeError)
    catalogue(failing)
    assert run([failing], tmp_path, lambda _: None, grid=Grid.REDUCED, force=True) == ["made-up"]
    assert store.read(tmp_path / "made", item) is not None


def test_a_verdict_that_fails_does_not_stop_the_pages(tmp_path, catalogue, monkeypatch):
    """On data of today's code that is a mistake, which the page names; on older ones it is not."""
    old = replace(made_up([]), name="old", title="Old")
    catalogue(old)
    run([old], tmp_path, lambda _: None, grid=Grid.REDUCED)

    item = made_up([])
    catalogue(item, changed(old, refusal="rows that today's code does not know"))
    for schema, said in (
        (store.ITEM_SCHEMA, "ValueError: rows that"),
        (store.ITEM_SCHEMA + 1, "Not computed yet: `polhode paper old`"),
    ):
        monkeypatch.setattr(store, "ITEM_SCHEMA", schema)
        assert run([item], tmp_path, lambda _: None, grid=Grid.REDUCED) == []
        page = (tmp_path / "made.md").read_text()
        assert "**Verdict: confirmed.**" in page
        assert said in page


def test_a_number_out_of_range_takes_the_verdict_away(tmp_path, catalogue):
    item = made_up([], slope=-1.1)
    catalogue(item)
    run([item], tmp_path, lambda _: None, grid=Grid.REDUCED)
    found = store.read(tmp_path / "made", item)
    assert found is not None
    assert item.experiment.judge(found[0]).word is Word.NOT_CONFIRMED
    assert "not confirmed" in (tmp_path / "README.md").read_text()


def test_tables_survive_their_files(tmp_path):
    item = made_up([])
    data = dict(item.experiment.compute(Grid.REDUCED))
    store.write(tmp_path, item, Grid.REDUCED, data.items())
    found = store.read(tmp_path, item)
    assert found is not None
    table, current, grid = found[0][""], found[1], found[2]
    assert current
    assert grid is Grid.REDUCED
    assert table["word"].tolist() == ["a,b"] * 5
    np.testing.assert_allclose(table["y"], data[""]["y"], rtol=10.0 ** (1 - store.DIGITS))


def test_groups_keep_order_and_rows():
    table = np.rec.fromarrays([[2.0, 1.0, 2.0], [1.0, 2.0, 3.0]], names="key,value")
    assert [(key, part.value.tolist()) for key, part in groups(table, "key")] == [
        (2.0, [1.0, 3.0]),
        (1.0, [2.0]),
    ]


@pytest.mark.parametrize(
    ("number", "value", "holds_for"),
    [
        (Number("n", 0.5, Range(0.0, 1.0, "why"), "rad"), "0.5 rad", "0 … 1"),
        (Number("n", 0.5, Range.at_most(1.0, "why")), "0.5", "≤ 1"),
        (
            Number("n", 0.5, Range.at_least(0.25, "why"), interval=(0.4, 0.6)),
            "0.5 (95 %: 0.4 … 0.6)",
            "≥ 0.25",
        ),
        (Number("n", 0.5695, interval=(0.548, 0.591)), "0.57 (95 %: 0.55 … 0.59)", "any value"),
        (
            Number("n", -1.23456, interval=(-1.23457, -1.23455)),
            "-1.235 (95 %: -1.235 … -1.235)",
            "any value",
        ),
        (Number("n", 2.0, interval=(-inf, inf)), "2 (95 %: -inf … inf)", "any value"),
        (Number("n", 1.8e-15, unit="rad", floor=1e-12), "below 1e-12 rad", "any value"),
        (Number("n", 1.234567e-3, floor=1e-12), "0.001235", "any value"),
        (Number("n", 0.5), "0.5", "any value"),
        (Number("share", 0.5, measure="six starts"), "0.5 of six starts", "any value"),
    ],
)
def test_numbers_as_the_pages_write_them(number, value, holds_for):
    assert number.holds
    assert measured(number) == value
    assert allowed(number) == holds_for


def test_nan_holds_nowhere():
    assert not Number("n", float("nan"), Range.at_most(1.0, "why")).holds


def test_power_law_recovers_exponent_and_covers_it():
    generator = np.random.default_rng(0)
    x = np.geomspace(1.0, 1e4, 12)
    covered = 0
    for _ in range(200):
        _, (low, high), _ = power_law(x, 3 * x**-0.8 * np.exp(generator.normal(scale=0.1, size=12)))
        covered += low <= -0.8 <= high
    assert 180 <= covered <= 199
    assert power_law(x, 3 * x**-0.8)[0] == pytest.approx(-0.8)


def test_median_interval_holds_the_median_it_was_drawn_from():
    """Of 20 values 5 or fewer, or 15 or more, lie below the median with a chance of 4.1 % (binomial)."""
    assert median_interval(np.arange(1.0, 21.0)) == (10.5, 6.0, 15.0)
    generator = np.random.default_rng(1)
    covered = 0
    for _ in range(400):
        _, low, high = median_interval(generator.exponential(size=31))
        covered += low <= np.log(2) <= high
    assert covered >= 0.94 * 400


def test_mean_interval_by_hand():
    mean, low, high = mean_interval(np.array([1.0, 2.0, 3.0]))
    assert mean == 2.0
    assert (high - mean, mean - low) == pytest.approx((4.302652729911275 / 3**0.5,) * 2)


def test_command_makes_a_page_with_small_figures(tmp_path):
    result = CliRunner().invoke(
        paper, ["symmetric-top", "--quick", "--svg", "--out", str(tmp_path)]
    )
    assert result.exit_code == 0, result.output
    folder = tmp_path / section_of(find_items(("symmetric-top",))[0]).name
    for ending in FIGURE_FORMATS:
        assert 0 < (folder / f"symmetric-top.{ending}").stat().st_size < LARGEST_FIGURE
    page = (tmp_path / "limits.md").read_text()
    for part in (
        "**Claim.**",
        "**Verdict: confirmed.**",
        "symmetric-top.png",
        "`polhode paper symmetric-top`",
    ):
        assert part in page
    index = (tmp_path / "README.md").read_text()
    assert "Made on the reduced grid, a look, not a result: " in index
    assert "[symmetric-top](limits.md#trajectory-of-a-symmetric-euler-top)" in index
    assert all(f"- *{word}*: " in index for word in Word)


def test_palette_keeps_common_and_rare_colours(tmp_path):
    """Shades of blue by the thousand, white around them, and three points of green, which must not turn blue."""
    generator = np.random.default_rng(4)
    pixels = np.full((200, 200, 3), 255, dtype=np.uint8)
    pixels[50:, :, 0] = generator.integers(0, 80, size=(150, 200))
    pixels[50:, :, 1] = generator.integers(60, 140, size=(150, 200))
    pixels[50:, :, 2] = generator.integers(150, 200, size=(150, 200))
    green = (0, 158, 60)
    pixels[60:63, 7] = green
    drawn = np.asarray(few_colours(Image.fromarray(pixels)).convert("RGB")).astype(int)
    assert (drawn[:50] == 255).all()
    assert np.max(np.abs(drawn[61, 7] - green)) < 40
    assert len(np.unique(drawn.reshape(-1, 3), axis=0)) <= 256
    by_frequency = np.asarray(Image.fromarray(pixels).quantize(256).convert("RGB")).astype(int)
    assert np.max(np.abs(by_frequency[61, 7] - green)) > 60


def test_figures_of_the_report_are_small():
    """Those of the repository, if the report is there: an installed package has none."""
    report = Path(__file__).parents[3] / "reports" / "paper"
    large = [
        path
        for ending in FIGURE_FORMATS
        for path in report.glob(f"*/*.{ending}")
        if path.stat().st_size > LARGEST_FIGURE
    ]
    assert not large


def test_command_takes_only_the_cores_that_it_may_use(tmp_path, monkeypatch):
    given = {}

    def no_run(*_: object, **settings: object) -> list[str]:
        given.update(settings)
        return []

    monkeypatch.setattr("polhode.harness.paper.reproduction.run", no_run)
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    result = CliRunner().invoke(paper, ["--quiet", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert given["processes"] == 1


def test_command_lists_items():
    result = CliRunner().invoke(paper, ["--list", "--json", "beyond"])
    assert [row["section"] for row in json.loads(result.output)] == ["beyond"] * 4


@pytest.mark.parametrize("arguments", [["no-such-item"], ["--force", "--redraw"], ["--json"]])
def test_command_refuses_bad_input(arguments, tmp_path):
    result = CliRunner().invoke(paper, [*arguments, "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert ", expected " in result.output
