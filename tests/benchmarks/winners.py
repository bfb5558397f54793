"""Does the suite name the winners that `polhode bench` measured on the same machine?

`python tests/benchmarks/winners.py SUITE.json BENCH` compares the JSON of the suite with a folder of
`polhode bench`: in each table and for each error, the suite's fastest method against the bench's.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from polhode.harness.common.store import read_export, record_file
from polhode.harness.common.text import short

# Errors for which both name a winner.
ERRORS = tuple(10.0**-exponent for exponent in range(2, 12))
# A winner that is slower than the best by no more than this is as good.
AS_GOOD = 1.2
METHOD = ["scene", "stokes", "form", "solver"]


def suite_runs(path: Path) -> pd.DataFrame:
    """Scene, St, form, solver, error and seconds of the timed rows."""
    benchmarks = json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
    return pd.DataFrame(
        {
            **{name: row["params"][name] for name in METHOD},
            "error": row["extra_info"]["result"]["slow_error"],
            "seconds": row["stats"]["min"],
        }
        for row in benchmarks
    )


def bench_runs(folder: Path) -> pd.DataFrame:
    """The same of the runs that reached their end."""
    return pd.DataFrame(
        {
            "scene": record["scene_name"],
            "stokes": float(record["scene"]["stokes"]),
            "form": record["form"],
            "solver": record["solver"],
            "error": record["slow_error"],
            "seconds": record["seconds"],
        }
        for record in read_export(record_file(folder))
        if record["status"] == "reached_end" and record.get("seconds")
    )


def fastest(runs: pd.DataFrame) -> pd.Series:
    """The run of the least time."""
    return runs.loc[runs["seconds"].idxmin()]


def compare(suite: pd.DataFrame, bench: pd.DataFrame) -> pd.DataFrame:
    """For each scene, St and error the suite's winner, the bench's, and the ratio of their times on the bench page."""
    rows = []
    tables = dict(iter(bench.groupby(["scene", "stokes"])))
    for (scene, stokes), own in suite.groupby(["scene", "stokes"]):
        others = tables.get((scene, stokes))
        if others is None:
            continue
        for error in ERRORS:
            good = own[own["error"] <= error]
            good_others = others[others["error"] <= error]
            if good.empty or good_others.empty:
                continue
            winner, best = fastest(good), fastest(good_others)
            same = (good_others[["form", "solver"]] == winner[["form", "solver"]]).all(axis=1)
            rows.append(
                {
                    "scene": scene,
                    "stokes": short(stokes),
                    "error": short(error),
                    "suite": f"{winner['form']} {winner['solver']}",
                    "bench": f"{best['form']} {best['solver']}",
                    "ratio": good_others[same]["seconds"].min() / best["seconds"],
                }
            )
    return pd.DataFrame(rows)


def main() -> None:
    """Print the pairs of winners that differ by more, and the share of the others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("suite", type=Path, help="JSON of pytest-benchmark")
    parser.add_argument("bench", type=Path, help="folder of `polhode bench`")
    given = parser.parse_args()
    found = compare(suite_runs(given.suite), bench_runs(given.bench))
    # A method that the bench did not time to that error has no ratio, and does not count as good.
    good = found["ratio"] <= AS_GOOD
    if not good.all():
        print(found[~good].to_string(index=False, float_format="%.2f"))
    print(f"{good.sum()} of {len(found)} winners within {AS_GOOD} times of the bench page's")


if __name__ == "__main__":
    main()
