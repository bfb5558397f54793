"""What the commands that measure share."""

from pathlib import Path
from shlex import split

import click
import pytest

from polhode.harness.cli import RunFailed
from polhode.harness.commands._study_options import FEW_TIMED_RUNS, command_line, steady, stored
from polhode.harness.commands.bench import bench, equal_error, paper
from polhode.harness.common.machine import machine, provenance
from polhode.harness.common.store import Store

STEADY, DISTURBED = {"disturbed": False}, {"disturbed": True}
PLACE = {
    "machine": {"processor": "One", "cores": 2, "system": "Linux", "python": "3.11"},
    "versions": {},
}


def test_disturbed_times_replace_no_earlier_page_of_this_machine_unless_told_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    page, records = tmp_path / "README.md", [DISTURBED] * FEW_TIMED_RUNS + [STEADY] * FEW_TIMED_RUNS
    for earlier in (None, "Measured on another machine."):
        if earlier:
            page.write_text(earlier)
        steady(records, page, anyway=False)
        assert (
            f"disturbed {FEW_TIMED_RUNS} of {2 * FEW_TIMED_RUNS} timed runs"
            in capsys.readouterr().err
        )
    page.write_text(f"Measured on {machine()['processor']}.")
    with pytest.raises(
        RunFailed,
        match=f"README.md: stays as it is, .* disturbed {FEW_TIMED_RUNS} of {2 * FEW_TIMED_RUNS} timed runs",
    ):
        steady(records, page, anyway=False)
    steady(records, page, anyway=True)
    steady([DISTURBED] * 5 + [STEADY] * 95, page, anyway=False)
    steady([{"status": "reached_end"}], page, anyway=False)
    assert not capsys.readouterr().err


@pytest.mark.parametrize("file", ["studies/mine.toml", "my $tudy.toml"])
def test_the_line_of_a_page_can_be_typed_again(file: str):
    words = [file, "--scene", "paper", "--problems"]
    with bench.make_context("polhode bench", [*words, "--quiet"]):
        assert split(command_line()) == ["polhode", "bench", *words]


def test_a_page_says_how_many_times_were_disturbed():
    records = [{**PLACE, **each} for each in (STEADY, DISTURBED, STEADY, {})]
    assert "Disturbed by other work: 1 of 3 timed runs (" in "\n".join(
        provenance("polhode bench", records)
    )


@pytest.mark.parametrize(
    ("name", "kept"), [("store", "previous.sqlite"), ("training", "previous-training.sqlite")]
)
def test_a_run_that_starts_afresh_keeps_the_last_store_and_copies_of_it(
    name: str, kept: str, tmp_path: Path
):
    with stored(tmp_path, resume=False, name=name) as store:
        store.put("a", {}, {})
    copy = tmp_path / f"{name}.sqlite.mine"
    copy.write_text("a copy")
    with stored(tmp_path, resume=False, name=name) as store:
        assert not store.keys()
    with Store(tmp_path / kept) as store:
        assert store.keys() == {"a"}
    assert copy.read_text() == "a copy"


@pytest.mark.parametrize(
    ("command", "folder"), [(equal_error, "reports/solvers"), (paper, "reports/paper")]
)
def test_a_quick_look_has_a_folder_of_its_own(command: click.Command, folder: str):
    for words, out in {
        "": folder,
        "--quick": f"{folder}-quick",
        "--out mine --quick": "mine",
    }.items():
        assert command.make_context("polhode", words.split()).params["out"] == Path(out)
