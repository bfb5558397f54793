"""What `solve` states of its own error, held against references."""

import pandas as pd
import pytest

from polhode.harness.calibration import stated as module
from polhode.harness.calibration.stated import judged, stated
from polhode.harness.common.store import Store
from polhode.harness.pages.pick import stated_summary, write_stated


def test_shares_and_factors():
    rows = [
        (1e-6, 2e-6, 1e-9, 1.0, 0.5),
        (1e-6, 5e-7, 1e-9, 1.0, 0.7),
        (1e-9, 1e-10, 1e-8, 1e-3, 4e-3),
    ]
    runs = pd.DataFrame(
        rows, columns=["error", "stated_high", "uncertainty", "seconds", "look_seconds"]
    )
    found = judged(runs)
    assert found["bounded"] == pytest.approx(2 / 3)
    assert found["factor"] == pytest.approx((2 + 0.5) / 2)
    assert found["cheap"] == pytest.approx(2 / 3)


def test_a_run_is_measured_once_and_its_statement_holds(tmp_path, monkeypatch):
    with Store(tmp_path / "stated.sqlite") as store:
        first = stated(store, 6, 2, quiet=True)
        monkeypatch.setattr(module, "_row", None)
        pd.testing.assert_frame_equal(stated(store, 6, 2, quiet=True), first)
    assert judged(first)["bounded"] == 1
    page = write_stated(tmp_path, first, "polhode validate --errors 2").read_text(encoding="utf-8")
    assert all(sentence in page for sentence in stated_summary(first))
    page = write_stated(tmp_path, first.assign(uncertainty=1.0), "x").read_text(encoding="utf-8")
    assert all(line.endswith(" – |") for line in page.splitlines() if line.startswith("| both"))
    assert len(first) + len(first.attrs["left_out"]) == 2
    assert len((tmp_path / "stated.csv").read_text(encoding="utf-8").splitlines()) == 1 + len(first)


def test_a_run_that_takes_too_long_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_ways", lambda known, tolerance: [("quaternion", "rk45")])
    monkeypatch.setattr(module, "REFERENCE_SECONDS", 1e-6)
    monkeypatch.setattr(module, "no_reference", lambda question: "")
    with Store(tmp_path / "stated.sqlite") as store:
        assert stated(store, 6, 2, quiet=True).attrs["left_out"] == ["time limit"] * 2
