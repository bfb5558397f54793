"""Which form when: the tables of README and docs are those of the committed maps."""

import re
from pathlib import Path

import pytest

from polhode.harness.analysis.pareto import Method
from polhode.harness.analysis.regime_map import Cell
from polhode.harness.answers.averaging_laws import ORDER_ONE, met_from
from polhode.harness.pages.regimes import read_cells
from polhode.harness.pages.which_form import BEGIN, END, in_words, tables, with_tables

ERRORS = ("slow_error", "orientation_error")
ROOT = Path(__file__).parents[3]
CELLS = ROOT / "reports" / "regimes" / "cells.csv"
PAGES = [ROOT / "README.md", ROOT / "docs" / "quickstart.md"]
here = pytest.mark.skipif(not CELLS.exists(), reason="no committed pages here")


@here
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_show_what_the_maps_say(page: Path):
    text = page.read_text(encoding="utf-8")
    maps = read_cells(CELLS)
    assert with_tables(text, maps) == text, "run python -m polhode.harness.pages.which_form"
    # Solvers that the words below the tables name do win there.
    words = re.sub(r"\s+", " ", text.partition(END)[2].partition("\n\nOne body")[0])
    winners = {cell.winner for panel in maps.values() for cell in panel if cell.winner}
    named = re.findall(r"`([\w-]+)`", words)
    assert {"quaternion", "averaged", "hybrid"} <= set(named)
    assert set(named) <= {name for winner in winners for name in winner}


@here
def test_the_answer_for_a_stokes_number_and_an_error_is_in_the_table():
    triaxial, spheroid = tables(read_cells(CELLS)).split("\n\n")
    for table in (triaxial, spheroid):
        header, _, *rows = table.strip().splitlines()
        assert [cell.strip() for cell in header.split("|")[2:5]] == [
            "L, E to 0.01",
            "L, E to 1e-4",
            "L, E to 1e-6",
        ]
        firsts = [row.split("|")[1].strip() for row in rows]
        ends = [float(number) for words in firsts for number in words.split(" to ")]
        assert ends == sorted(ends)
        assert (ends[0], ends[-1]) == (1e-4, 1e8)


@pytest.mark.parametrize(
    ("form", "solver", "words"),
    [
        ("quaternion", "cyrk-radau", "full, implicit"),
        ("quaternion", "taylor", "full"),
        ("spheroid-axis", "stroboscopic", "full, split"),
        ("averaged-spheroid", "cyrk-dop853", "first order"),
        ("averaged-second-order", "cyrk-bdf", "second order"),
        ("hybrid", "cyrk-vern8", "hybrid"),
    ],
)
def test_a_winner_in_words(form: str, solver: str, words: str):
    assert in_words(Method(form, solver)) == words
    assert in_words(None) == "–"


def test_an_averaged_form_is_named_from_the_st_on_that_random_bodies_need():
    first = Method("averaged", "cyrk-vern8")
    full = Method("quaternion", "taylor")
    needed = max(met_from(ORDER_ONE, kind, 1e-2) for kind in ("stays", "resonance", "crosses"))
    assert 1e4 < needed < 1e5
    maps = {}
    for body in ("ellipsoid", "spheroid"):
        for error in ERRORS:
            winner = first if (body, error) == ("ellipsoid", "slow_error") else full
            maps[body, error] = [
                Cell(stokes, target, True, winner, full)
                for stokes in (needed / 1.01, needed * 1.01)
                for target in (1e-2, 1e-4, 1e-6)
            ]
    rows = tables(maps).splitlines()
    assert [row.split("|")[2].strip() for row in rows[2:4]] == ["full", "first order"]


def test_a_page_without_a_place_is_refused():
    with pytest.raises(ValueError, match="got a page without"):
        with_tables(f"# Page\n{BEGIN}", {})
