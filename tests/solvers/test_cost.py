"""Costs are measured where they arise."""

import pytest

from oracle.classical import CLASSICAL
from oracle.runs import Run
from polhode.harness.common.worker import Worker
from polhode.harness.studies.cost import first_run, rhs_seconds

QUATERNION = Run("triaxial", "quaternion").problem
RIGID_BODY = CLASSICAL["rigid-body"].problem


def test_a_right_hand_side_is_cheaper_the_less_python_there_is():
    compiled, numba, python = (
        rhs_seconds(QUATERNION, backend) for backend in ("compiled", "numba", "python")
    )
    assert 1e-9 < compiled < numba < python < 1e-4
    # The longer field takes longer, in whatever way it is called.
    assert rhs_seconds(RIGID_BODY, "compiled") < compiled
    assert rhs_seconds(RIGID_BODY, "python") < python


def measured(solver: str, folder: str) -> list:
    with Worker() as worker:
        replies = [
            worker.run(first_run, QUATERNION, solver, 1e-6, folder, limit=60.0) for _ in range(2)
        ]
    assert [reply.message for reply in replies] == ["", ""]
    return [reply.value for reply in replies]


def test_cold_and_warm_first_runs_of_taylor(tmp_path):
    folder = str(tmp_path / "cache")
    (cold, again), (warm, _) = measured("taylor", folder), measured("taylor", folder)
    # heyoka finds its code on disk in the second process, and everything in memory in the second
    # call.
    assert cold.compilation > 2 * warm.compilation > 2 * again.compilation
    assert cold.library > 0.01 > again.library
    assert warm.run == pytest.approx(again.run, rel=5.0)


def test_first_run_of_a_callback(tmp_path):
    first, second = measured("dop853", str(tmp_path))
    assert first.compilation > 0.05 > second.compilation
