"""Names of version 0.1: each gives what its successor gives, and says which that is."""

import inspect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from polhode import Problem, solve
from polhode.harness.solution import SceneSolution
from polhode.models import problem as problems
from polhode.models.problem import ParameterTable
from polhode.solvers.taylor import Taylor


def warned(words: str) -> Any:
    """The context in which a warning with these words is expected."""
    return pytest.warns(DeprecationWarning, match=f"^{words}; the former name goes")


@pytest.fixture(scope="module")
def solution() -> SceneSolution:
    """A run of several segments."""
    return solve("paper", form="hybrid", tolerance=1e-6, samples=11)


def test_solutions(solution: SceneSolution):
    with warned("SceneSolution.pieces is now SceneSolution.segments"):
        assert solution.pieces == solution.segments
    with warned("SceneSolution.pieces_in_words is now SceneSolution.segments_in_words"):
        assert solution.pieces_in_words(most=1) == solution.segments_in_words(most=1)
    with warned("Solution.stages is now Solution.segments"):
        assert solution.run.stages is solution.run.segments
    with warned("RunError.wanted is now RunError.of"):
        assert solution.error.wanted("slow") is solution.error.slow
    assert solution.provenance()["pieces"] == solution.provenance()["segments"] != []


def test_problems(solution: SceneSolution):
    problem = solution.run.problem
    with warned("Problem.course is now Problem.next_segment"):
        assert problem.course is problem.next_segment is not None
    with warned("course= of Problem is now next_segment="):
        assert replace(problem, course=None).next_segment is None
    table = ParameterTable(np.array([0.0, 1.0]), np.array([[2.0]]))
    with warned("segments= of Problem is now parameter_table="):
        assert replace(problem, segments=table).parameter_table is table
    assert "next_segment" in inspect.signature(Problem).parameters


@pytest.mark.parametrize(
    ("former", "present"),
    [("Piece", "Segment"), ("Course", "NextSegment"), ("Segments", "ParameterTable")],
)
def test_parts_of_problems(former: str, present: str):
    with warned(f"polhode.models.problem.{former} is now {present}"):
        assert getattr(problems, former) is getattr(problems, present)


def test_the_warning_names_the_users_line():
    with pytest.warns(DeprecationWarning, match="Piece is now Segment") as warnings:
        problems.Piece  # noqa: B018
    assert [warning.filename for warning in warnings] == [__file__]


def test_other_names_are_unknown():
    with pytest.raises(AttributeError, match=r"'polhode.models.problem' has no attribute 'Pieces'"):
        problems.Pieces  # noqa: B018


def test_solvers_that_set_former_names():
    with warned("Own.wears is now error_amplification"):

        class Own(Taylor):
            wears = 7.0

    assert Own.error_amplification == 7.0
    with warned("Taylor.wears is now Taylor.error_amplification"):
        assert Taylor().wears == Taylor.error_amplification


def test_a_warning_names_the_line_that_used_the_name(solution: SceneSolution):
    with pytest.warns(DeprecationWarning, match="pieces") as caught:
        assert solution.pieces
    assert caught[0].filename == __file__
