"""The page of solvers that know St: ratios at equal error, and whether they reach their targets."""

from pathlib import Path

import pytest

from polhode.harness.common.machine import machine
from polhode.harness.pages import known_stokes
from polhode.harness.studies.study import parse_study

STUDY = {
    "name": "two",
    "title": "Two",
    "samples": 11,
    "max_seconds": 1.0,
    "tolerances": [1e-6],
    "forms": ["spheroid-axis"],
    "solvers": ["splitting"],
    "page": "known-stokes",
    "scenes": [
        {
            "name": "spheroid",
            "stokes": [1e3, 1e6],
            "slow_time": 1e-3,
            "shape": {"semi_axes": [1.0, 1.0, 2.0]},
            "start": {"euler_angles": [1.0, 0.5, 0.0], "euler_rates": [1.0, 1.0, 1.0]},
        }
    ],
}


def run(solver: str, stokes: float, error: float, seconds: float) -> dict:
    scene = {
        "scene_name": "spheroid",
        "scene": {"stokes": stokes},
        "machine": machine(),
        "versions": {},
    }
    method = {
        "form": "spheroid-axis",
        "solver": solver,
        "tolerance": error,
        "status": "reached_end",
    }
    errors = {f"{want}_error": error for want in ("slow", "orientation")}
    errors |= {f"{want}_uncertainty": 1e-16 for want in ("slow", "orientation")}
    return scene | method | errors | {"seconds": seconds}


@pytest.mark.parametrize(("seconds", "sign"), [(1e-3, "✓"), (1e-2, "✕")])
def test_ratios_at_equal_error(tmp_path: Path, seconds: float, sign: str):
    records = [
        *(run("splitting", 1e6, error, seconds) for error in (1e-5, 1e-10)),
        *(run("taylor", 1e6, error, 0.03) for error in (1e-5, 1e-10)),
        *(run("cyrk-vern8", 1e6, error, time) for error, time in ((1e-4, 1e-4), (1e-8, 1e-2))),
        run("stroboscopic", 1e6, 2e-9, 5e-4),
    ]
    page = known_stokes.write_page(
        parse_study(STUDY), records, tmp_path, "polhode bench"
    ).read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| spheroid"))
    cells = [cell.strip() for cell in row.split("|")[3:-1]]
    # Vern8's time at 1e-6 lies in the middle of its logarithms.
    assert cells[2].startswith(f"{1e-3 / seconds:.2g} (cyrk-vern8")
    assert cells[4] == f"{1e-2 / seconds:.2g} (cyrk-vern8, 10 ms) {sign} ≥ 4.5"
    assert cells[5] == f"{0.03 / seconds:.2g} (taylor, 30 ms)"
    assert f"reaches {1 if sign == '✓' else 0} of 2" in page
    assert "60 times as fast, requested: 30" in page
    assert "times as long as that at 1e6" in page
    assert "is 2.0e-9, requested" in page
    alone = known_stokes.write_page(
        parse_study(STUDY), records[-1:], tmp_path, "polhode bench"
    ).read_text(encoding="utf-8")
    assert "no solver that does not know St gets there" in alone


def test_the_longer_run_is_measured_once_for_the_same_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    measured = iter([0.5, 0.7])
    monkeypatch.setattr(known_stokes, "_longer", lambda *_: next(measured))
    study, record = parse_study(STUDY), run("stroboscopic", 1e6, 2e-9, 5e-4)

    def said(seconds: float) -> str:
        path = known_stokes.write_page(
            study, [record | {"seconds": seconds}], tmp_path, "polhode bench"
        )
        return path.read_text(encoding="utf-8")

    assert said(5e-4) == said(5e-4)
    assert "takes 0.7 times as long" in said(6e-4)
