"""`pick` without parts of its race: each part can be left out, and comes back."""

import pandas as pd

from polhode.harness.answers import race, tolerances
from polhode.harness.answers.ablation import ALL_PARTS, RACE_PARTS, compared, left_out
from polhode.harness.answers.pick import forget, pick
from polhode.harness.commands import pick as command
from polhode.harness.pages.ablation import write_page
from polhode.models.scenes import named_scene


def test_every_part_is_there_and_comes_back():
    for part in RACE_PARTS:
        kept = getattr(part.place, part.name)
        with left_out(part):
            assert getattr(part.place, part.name) is part.without
            assert kept is not part.without
        assert getattr(part.place, part.name) is kept
    assert len({part.words for part in RACE_PARTS} | {ALL_PARTS}) == len(RACE_PARTS) + 1


def test_a_race_follows_what_is_left_out():
    """Without the limit of their cost all methods of the list run to their end."""
    scene = named_scene("paper")

    def cut() -> int:
        forget()
        return sum("costs more than" in row.reason for row in pick(scene, 1e-8).excluded)

    (part,) = [part for part in RACE_PARTS if (part.place, part.name) == (race, "TIED")]
    assert cut()
    with left_out(part):
        assert not cut()
    forget()


def rows(*races: tuple[str, str, str, float, bool, float]) -> list[dict]:
    columns = ["scene", "without", "choice", "seconds", "met", "asking"]
    return [dict(zip(columns, race, strict=True)) | {"error": 0.0} for race in races]


def test_choices_are_counted_by_time_and_by_error(tmp_path):
    part = next(part for part in RACE_PARTS if part.place is tolerances)
    table = rows(
        ("1", ALL_PARTS, "a", 1.0, True, 0.1),
        ("1", part.words, "b", 2.0, True, 0.2),
        ("2", ALL_PARTS, "a", 1.0, True, 0.1),
        ("2", part.words, "a", 1.0, True, 0.1),
        ("3", ALL_PARTS, "a", 1.0, True, 0.1),
        ("3", part.words, "b", 0.1, False, 0.3),
        ("4", ALL_PARTS, "", float("nan"), False, 0.1),
        ("4", part.words, "b", 0.1, True, 0.2),
    )
    (row,) = compared(pd.DataFrame(table))
    assert row["changed"] == 3
    assert (row["slower"], row["quicker"], row["lost"], row["won"]) == (1, 0, 1, 1)
    assert row["asking"] == 2.0
    assert row["asking_all"] == 2.0
    page = write_page(tmp_path, table, "polhode validate --ablation").read_text(encoding="utf-8")
    assert f"worse on 2 of 4 scenes and better on 1: {part.words}" in page


def test_the_command_measures_and_writes_the_page(tmp_path, monkeypatch):
    from click.testing import CliRunner

    monkeypatch.setattr("polhode.harness.answers.ablation.RACE_PARTS", RACE_PARTS[:1])
    options = ["--ablation", "--scenes", "1", "--seed", "27", "--quiet", "--out", str(tmp_path)]
    done = CliRunner().invoke(command.validate, options)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "ablation.csv").read_text(encoding="utf-8").count("\n") == 3
    assert "part left out" in (tmp_path / "ablation.md").read_text(encoding="utf-8")
