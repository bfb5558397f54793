"""The scenario in ASlib's format: its files, and what their rows say."""

import pandas as pd

from polhode.harness.calibration.scenes import questions
from polhode.harness.calibration.selection import COLUMNS, PICK
from polhode.harness.pages.pick import write_aslib


def test_the_scenario_has_aslibs_files(tmp_path):
    first, second = questions(1, 2)
    rows = [
        ("s", "short", "quaternion/taylor/-1", 2.0, True),
        ("s", "short", PICK, 1.5, True),
        ("l", "long", "quaternion/taylor/-1", 30.0, True),
        ("l", "long", "quaternion/radau/+0", 5.0, False),
    ]
    write_aslib(tmp_path, {"s": first, "l": second}, pd.DataFrame(rows, columns=list(COLUMNS)))
    tables = ("algorithm_runs", "cv", "feature_costs", "feature_runstatus", "feature_values")
    assert {path.name for path in tmp_path.iterdir()} == {
        "description.txt",
        *(f"{name}.arff" for name in tables),
    }
    runs = (
        (tmp_path / "algorithm_runs.arff")
        .read_text(encoding="utf-8")
        .partition("@DATA\n")[2]
        .splitlines()
    )
    assert runs[0] == "s,1,quaternion/taylor/-1,2,ok"
    assert runs[2] == "l,1,quaternion/radau/+0,5,other"
    assert len(runs) == 3
    values = (tmp_path / "feature_values.arff").read_text(encoding="utf-8")
    assert len(values.partition("@DATA\n")[2].splitlines()[0].split(",")) == values.count(
        "@ATTRIBUTE"
    )
    description = (tmp_path / "description.txt").read_text(encoding="utf-8").splitlines()
    assert "algorithm_cutoff_time: 900" in description
    assert description[-6::3] == ["  quaternion/radau/+0:", "  quaternion/taylor/-1:"]
