"""The pytest-benchmark suite takes forms and solvers from outside."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_outside_forms_and_solvers_are_timed(tmp_path: Path):
    command = [
        sys.executable,
        "-P",
        "-m",
        "pytest",
        "tests/benchmarks",
        "-o",
        "python_files=bench_*.py",
    ]
    command += ["-o", "pythonpath=tests docs/examples", "-p", "no:cacheprovider", "--collect-only"]
    command += [
        "--with-solver",
        "own_solver:ClassicalRungeKutta",
        "--with-form",
        "own_form:Directions",
    ]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert "100-quaternion-own_solver:ClassicalRungeKutta-0.0001" in done.stdout, done.stderr
    assert "1000-own_form:Directions-taylor-1e-07" in done.stdout
