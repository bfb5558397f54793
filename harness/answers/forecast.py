"""Forecasts of long runs: from a shorter segment, and from the growth of steps and errors."""

from dataclasses import dataclass, replace
from math import inf

from polhode.harness.answers.averaging import oriented
from polhode.harness.answers.rules import rotations, stiff
from polhode.harness.references.rotations import damping_times
from polhode.models.scene import Scene

# Rotations of a segment: what a race of a run of as many costs is a few milliseconds.
_LEAST_TURNS = 60.0
# Ratio of the rotations of a segment and of the run: fifteen runs of it cost less than the run.
_SHARE = 0.04
# Share of a run from which on the beginning serves, not the surrogate.
_MOST_SHARE = 0.25
# Share of a run from which on all of it is raced on.
_WHOLE = 0.5
# Rotations of a segment, at most.
_MOST_TURNS = 1_000.0
# Rotations in a damping time from which on the slow motion, and the steps of a rotation, are the same
# at every St.
_FAST = 25.0
# Rotations of the shear in the beginning of a stiff run: it holds the turns where steps are short.
_STIFF_TURNS = 20.0
# How errors grow with the rotations that a segment leaves out, as a power, by what is raced on and
# what the errors are of: as many as nine of ten runs have. Those of L and E add up, and the phase
# follows them; on a beginning damping has not yet forgotten any.
_GROWTH = {
    ("surrogate", "slow"): 1.0,
    ("surrogate", "orientation"): 2.0,
    ("beginning", "slow"): 0.8,
    ("beginning", "orientation"): 1.5,
    ("stiff", "slow"): 0.0,
    ("stiff", "orientation"): 0.5,
    ("splitting", "slow"): 0.8,
    ("splitting", "orientation"): 1.5,
}
# Errors and seconds of a run that was raced itself, over and under what the race saw.
_RACED = 1.25
# The same of a forecast, and how it grows with the rotations that were left out, as a power.
_FORECAST = 1.6
_FORECAST_GROWTH = 0.1


@dataclass(frozen=True)
class RacedSegment:
    """The scene that methods are raced on: the scene itself, its surrogate at a smaller St, or its beginning."""

    scene: Scene
    kind: str  # "scene", "surrogate" or "beginning"
    ratio: float  # rotations of the run over those of the segment, 1 for the scene itself
    turns: float  # rotations of the run, about
    splits: bool = False  # whether it is for splitting
    run: Scene | None = None  # the scene that it stands for, where that is another one

    @property
    def whole(self) -> bool:
        """Whether the scene itself is raced on."""
        return self.kind == "scene"

    def growth(self, want: str) -> float:
        """Ratio of the errors of the run and of the segment, for a method at one tolerance."""
        if self.whole:
            return 1.0
        kind = self.kind
        if stiff(self.scene):
            kind = "stiff"
        if self.splits:
            kind = "splitting"
        return self.ratio ** _GROWTH[kind, want]

    def of_the_whole(self) -> "RacedSegment":
        """The scene itself instead."""
        return RacedSegment(self.run or self.scene, "scene", 1.0, self.turns)

    @property
    def spread(self) -> float:
        """Factor on either side of what is forecast, of errors and seconds."""
        return _RACED if self.whole else _FORECAST * self.ratio**_FORECAST_GROWTH


def raced_segment(scene: Scene) -> RacedSegment:
    """The segment to race on instead of a scene."""
    scene = oriented(scene)
    turns = rotations(scene)
    damped = damping_times(scene)
    if stiff(scene):
        return _beginning(scene, turns, _STIFF_TURNS)
    least = max(_LEAST_TURNS, min(_MOST_TURNS, _SHARE * turns))
    if 0 < scene.stokes < inf and turns > _FAST * damped:
        slow = max(least, _FAST * damped)
        if slow < _MOST_SHARE * turns:
            ratio = slow / turns
            shorter = replace(scene, stokes=scene.stokes * ratio, time=scene.time * ratio)
            return RacedSegment(shorter, "surrogate", 1 / ratio, turns, run=scene)
    return _beginning(scene, turns, least)


def beginning_of(scene: Scene) -> RacedSegment:
    """The beginning of a scene, on which splitting is raced."""
    turns = rotations(scene)
    return replace(_beginning(scene, turns, max(_LEAST_TURNS, _SHARE * turns)), splits=True)


def _beginning(scene: Scene, turns: float, least: float) -> RacedSegment:
    if _WHOLE * turns <= least:
        return RacedSegment(scene, "scene", 1.0, turns)
    ratio = least / turns
    shorter = replace(scene, time=scene.time * ratio)
    return RacedSegment(shorter, "beginning", 1 / ratio, turns, run=scene)
