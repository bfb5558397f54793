"""Forecasts of long runs: from a shorter segment, and from the growth of steps and errors.

A segment of a long run is one of two shorter scenes. Its surrogate has a smaller St and a time that is
shorter by the same ratio: it moves through the same slow time T/St, with fewer rotations in it. Its
beginning has the same St and a shorter time. A rotation is a turn of the body by 2π rad.
"""

from dataclasses import dataclass, replace
from math import inf

from polhode.harness.answers.averaging import COMPARED_TURNS, oriented
from polhode.harness.answers.rules import rotations, stiff
from polhode.harness.references.rotations import damping_times
from polhode.models.scene import Scene

# Rotations of a segment, at least: to race them takes a few milliseconds. An estimate: with fewer the steps
# at the start count for more than the steps of a rotation.
_LEAST_TURNS = 60.0
# Share of the run that a segment is, in rotations, unless a limit below changes it: a race makes some
# fifteen runs of it, which together take less than the run itself. An estimate.
_SHARE = 0.04
# A segment of more than this share of the run would spare little: then the run itself is raced on. An
# estimate.
_WHOLE = 0.5
# Rotations in a damping time from which on a surrogate stands for the run: the slow motion and the steps of a
# rotation are then the same at every St. An estimate: a larger number makes longer segments.
_FAST = 25.0
# Factor on either side of errors and seconds that the race saw on the run itself. It is an estimate, and so are
# the intervals that `pick` states by it.
_RACED = 1.5
# The same of a forecast from a segment, which errs by factors.
_FORECAST = 2.2


@dataclass(frozen=True)
class RacedSegment:
    """The scene that methods are raced on: the scene itself, its surrogate at a smaller St, or its beginning."""

    scene: Scene
    kind: str  # "scene", "surrogate" or "beginning"
    ratio: float  # rotations of the run over those of the segment, 1 for the scene itself
    turns: float  # rotations of the run, about
    run: Scene | None = None  # the scene that it stands for, where that is another one

    @property
    def whole(self) -> bool:
        """Whether the scene itself is raced on."""
        return self.kind == "scene"

    def growth(self, want: str) -> float:
        """Ratio of the errors of the run and of the segment, for a full form by a method at one tolerance.

        Errors of L and E add up in proportion to the rotations, so their power of `ratio` is 1; in stiff
        scenes, where damping forgets them, it is 0. The orientation has one power more: its phase is
        the integral over time of the errors of L and E.
        """
        power = 0 if stiff(self.scene) else 1
        return self.ratio ** (power + (want == "orientation"))

    def of_the_whole(self) -> "RacedSegment":
        """The scene itself instead."""
        return RacedSegment(self.run or self.scene, "scene", 1.0, self.turns)

    @property
    def spread(self) -> float:
        """Factor on either side of what is forecast, of errors and seconds."""
        return _RACED if self.whole else _FORECAST


def raced_segment(scene: Scene) -> RacedSegment:
    """The segment to race on instead of a scene."""
    scene = oriented(scene)
    turns = rotations(scene)
    # Rotations that a surrogate needs so that it has `_FAST` of them in each damping time.
    surrogate_turns = max(_least(turns), _FAST * damping_times(scene))
    if stiff(scene) or not 0 < scene.stokes < inf or surrogate_turns >= _WHOLE * turns:
        return beginning_of(scene)
    ratio = surrogate_turns / turns
    shorter = replace(scene, stokes=scene.stokes * ratio, time=scene.time * ratio)
    return RacedSegment(shorter, "surrogate", 1 / ratio, turns, run=scene)


def beginning_of(scene: Scene) -> RacedSegment:
    """The beginning of a scene, or where that is most of it the scene itself."""
    turns = rotations(scene)
    least = _least(turns)
    if least >= _WHOLE * turns:
        return RacedSegment(scene, "scene", 1.0, turns)
    ratio = least / turns
    shorter = replace(scene, time=scene.time * ratio)
    return RacedSegment(shorter, "beginning", 1 / ratio, turns, run=scene)


def _least(turns: float) -> float:
    """Rotations of a segment of a run, at least.

    `COMPARED_TURNS` are enough to tell how errors grow, however long the run is.
    """
    return max(_LEAST_TURNS, min(COMPARED_TURNS, _SHARE * turns))
