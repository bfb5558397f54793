"""Does the suite name the winners that `polhode bench` measured on the same machine?

`python tests/benchmarks/winners.py SUITE.json BENCH` compares the JSON of the suite, which `make benchmark`
leaves in `.benchmarks`, with a folder of `polhode bench`: in each table and for each error, the suite's
fastest method against the bench's.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from polhode.harness.common.store import read_export, record_file
from polhode.harness.common.text import short

# Errors of L and E over I_max for which both name a winner: one in each decade, from 1e-2 to 1e-11.
ERRORS = tuple(10.0**-exponent for exponent in range(2, 12))
# A winner that takes no more than this multiple of the best one's time is as good: an estimate of how far
# times of one run lie apart from suite to bench.
AS_GOOD = 1.2
# Columns that tell tables and methods apart.
METHOD = ["scene", "stokes", "form", "solver"]


def suite_runs(path: Path) -> pd.DataFrame:
    """The timed runs of the suite: scene, St, form, solver, error of L and E over I_max, least seconds."""
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
    """The same columns, of the bench's runs that reached their end."""
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
    """The run of the least time, a row."""
    return runs.loc[runs["seconds"].idxmin()]


def compare(suite: pd.DataFrame, bench: pd.DataFrame) -> pd.DataFrame:
    """The suite's winner beside the bench's, for each scene, St and error at which both name one.

    `ratio` is the time of the suite's winner over that of the bench's, both as the bench measured them.
    """
    rows = []
    tables = dict(iter(bench.groupby(["scene", "stokes"])))
    for (scene, stokes), suite_table in suite.groupby(["scene", "stokes"]):
        bench_table = tables.get((scene, stokes))
        if bench_table is None:
            continue
        for error in ERRORS:
            suite_good = suite_table[suite_table["error"] <= error]
            bench_good = bench_table[bench_table["error"] <= error]
            if suite_good.empty or bench_good.empty:
                continue
            winner = fastest(suite_good)
            best = fastest(bench_good)
            same = (bench_good[["form", "solver"]] == winner[["form", "solver"]]).all(axis=1)
            rows.append(
                {
                    "scene": scene,
                    "stokes": short(stokes),
                    "error": short(error),
                    "suite": f"{winner['form']} {winner['solver']}",
                    "bench": f"{best['form']} {best['solver']}",
                    "ratio": bench_good[same]["seconds"].min() / best["seconds"],
                }
            )
    return pd.DataFrame(rows)


def main() -> None:
    """Print the pairs of winners that differ by more, and the share of the others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("suite", type=Path, help="JSON of pytest-benchmark")
    parser.add_argument("bench", type=Path, help="folder of `polhode bench`")
    given = parser.parse_args()
    pairs = compare(suite_runs(given.suite), bench_runs(given.bench))
    # A method that the bench did not time to that error has no ratio, and does not count as good.
    good = pairs["ratio"] <= AS_GOOD
    if not good.all():
        print(pairs[~good].to_string(index=False, float_format="%.2f"))
    print(f"{good.sum()} of {len(pairs)} winners within {AS_GOOD} times of the bench page's")


if __name__ == "__main__":
    main()
