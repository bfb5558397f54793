"""A run of several segments says what it did: in the solution, on the terminal."""

import pickle

import pytest
from commandline import Run

from polhode.harness.api import solve
from polhode.harness.solution import SceneSolution
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid


@pytest.fixture(scope="module")
def solution() -> SceneSolution:
    scene = Scene(Ellipsoid((1.0, 1.0, 2.0)), 1e5, EulerStart((1.0, 0.3, 0.2)), 2e4)
    return solve(
        scene, form="hybrid", solver="cyrk-vern8", tolerance=1e-6, estimate=False, samples=11
    )


def test_a_solution_knows_its_segments(solution: SceneSolution):
    first, second = solution.segments[0], solution.segments[-1]
    assert (first.begin, second.end) == (0.0, pytest.approx(0.2))
    assert "|L|" in first.reason
    assert first.error > 0
    assert second.error > 0
    assert second.angle > second.error
    lines = [line for line in repr(solution).splitlines() if line.startswith("  segment: ")]
    assert len(lines) == len(solution.segments)
    assert "full equations" in lines[0]
    assert pickle.loads(pickle.dumps(solution)).segments == solution.segments


def test_many_segments_are_cut_short(solution: SceneSolution):
    assert solution.segments_in_words(most=1) == [f"{len(solution.segments)} segments more"]


def test_the_command_notes_them(here: Run):
    given = ("--form", "hybrid", "--solver", "cyrk-vern8", "--tolerance", "1e-6", "--samples", "3")
    assert "note: t₂ = 0 to " in here("solve", "spheroid", *given).stderr
