"""The benchmark suite from a checkout: ``pytest tests/benchmarks -o python_files='bench_*.py'``."""

from polhode.harness.benchmarks.test_suite import pytest_generate_tests, references, test_solve

__all__ = ["pytest_generate_tests", "references", "test_solve"]
