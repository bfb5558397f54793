"""How much there is to integrate: rotations on the oscillatory side, stiffness on the other.

Run times of full forms follow these two numbers, not St alone. A rotation is 2π rad of turning, whatever
the axis: their number is N = ∫|ω| dt/2π.

Symbols: ω is the angular velocity in shear rates, and T the scene's time. X and I are the resistance and the
moment of inertia about one body axis: 8πX/I is its damping rate at St = 1 (`Ellipsoid.damping`).
Section `DAC`, "Discussions and Conclusions", of the paper (docs/references.md) scales starts from rest.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from math import isinf, pi, sqrt

import numpy as np

from polhode.models.catalogue import averaged_form, form as find_form, reference_form
from polhode.models.forms import jeffery, quaternion
from polhode.models.forms.motion import AlongTrack
from polhode.models.free_top.polhode import mean_speed
from polhode.models.operations import WithRate
from polhode.models.problem import Factory, Problem
from polhode.models.scene import Scene, SlowStart, start_from
from polhode.solvers.catalogue import available_like
from polhode.solvers.solve import solve

# Tolerances of loose runs: of explicit ones, which are cheap enough to follow a chaotic scene for a while, of
# stiff ones, and of averaged ones. All three are estimates: a number of rotations need be known to a few per
# cent alone.
_LOOSE_TOLERANCE = 1e-9
_STIFF_TOLERANCE = 1e-6
_AVERAGED_TOLERANCE = 1e-6
# Rotations from which on averages are cheaper than a loose run, and no less accurate. An estimate.
MANY = 1000.0
# Longest segment of a run, in rotations, or on the stiff side in inverse shear rates: some tenths of a second.
# The rest is extrapolated, at the mean rate of the segment's second half. Both are estimates.
LONGEST_ROTATIONS = 1e5
LONGEST_STIFF = 5e3
# Damping rate, in shear rates, from which an implicit method takes fewer steps than stability allows an
# explicit one; an estimate.
_STIFF_FROM = 30.0
# Least |ω| √(St I/8πX). If |ω| is below the shear rate, the square is an angle in order of magnitude: by it
# the body turns while the torque changes |ω| by |ω| (section `DAC`). Averages over a rotation need ω to change
# little in it. An estimate.
_SEPARATED = 1.5
# From rest a body turns by some 100 rad within this multiple of √(St I/8πX). It is then so fast that
# averages serve from there on. An estimate; whether they serve is checked there.
_RISEN = 20.0
# Angular velocity, in shear rates, at which the fluid turns, and a body at rest before long.
_FLUID_SPEED = 0.5
# Nodes of the quadrature of the averaged speed over a run. An estimate: the averaged speed is smooth.
_NODES = 64
# Steps of an averaged run, at most, so that none goes on without end; an estimate.
_MAX_AVERAGED_STEPS = 100_000
# Damping times from which on stability may hold an explicit method back. An estimate: with fewer of them an
# explicit run takes some 0.28 × 20,000 steps at most for stability, which is cheap.
STIFF = 2e4
# Damping times that a rotation, and a unit of time that follows the flow, outweigh, together. With
# more of them stability asks for more than 0.4 of the steps, and errors do not follow the
# tolerance. Those of Taylor's method, whose order is higher, still do. Both numbers follow from
# counts of cyrk-vern8's steps at 1e-9 in the quaternion form. It takes 8 steps in a rotation, 1.6
# in a unit of following time and 0.28 in a damping time. Since 0.28 S must be 0.4 of all steps, they are
# 8 × 0.4/0.6/0.28 and 1.6 × 0.4/0.6/0.28. The share 0.4 is an estimate.
_PER_ROTATION = 19.0
_PER_TIME = 3.8


def damping_times(scene: Scene) -> float:
    """S = T max(8πX/I)/St: the duration in units of the shortest damping time; 0 without inertia or torque."""
    if scene.stokes == 0 or isinf(scene.stokes):
        return 0.0
    return scene.time * max(scene.ellipsoid.damping) / scene.stokes


def following_time(scene: Scene) -> float:
    """F = TS/(T + S): the time spent following the flow, in inverse shear rates.

    S/T is the damping rate. F is all of T if damping is fast, S if it is slow, and 0 without
    torque; between these limits the formula is an estimate.
    """
    damped = damping_times(scene)
    return scene.time if scene.stokes == 0 else scene.time * damped / (scene.time + damped)


# The number of scenes kept bounds memory alone.
@lru_cache(maxsize=1000)
def is_stiff(scene: Scene, turns: float | None = None) -> bool:
    """Whether stability, not the tolerance, sets the steps of an explicit method.

    `turns` is the number of rotations if the caller knows it. Else `rotations` counts them where
    the damping times are many, and may raise its ValueError.
    """
    damped = damping_times(scene)
    if damped <= STIFF:
        return False
    turns = rotations(scene) if turns is None else turns
    return damped > _PER_ROTATION * turns + _PER_TIME * following_time(scene)


def rotations(scene: Scene) -> float:
    """Number of rotations N = ∫|ω| dt/2π of a scene, within two per cent, as the tests check.

    It follows from the averaged slow variables where they are valid and N is large, in milliseconds.
    Else a loose run integrates |ω| along, in some tenths of a second if it is long. In a chaotic
    scene N is known no better than the scene itself. Raises ValueError if that run fails, or if the
    start has no orientation and the averaged equations do not apply.
    """
    slow_start = isinstance(scene.start, SlowStart)
    if (slow_start or _averages_well(scene)) and (turned := _averaged_angle(scene)) is not None:
        return turned / (2 * pi)
    if slow_start:
        got = "L and E alone, and the averaged equations break down on the way"
        raise ValueError(f"start: {got}, expected a quaternion")
    return _angle(scene) / (2 * pi)


def _averages_well(scene: Scene) -> bool:
    """Whether averages over a rotation are valid from the start on, and N is large."""
    turns = scene.time * max(_speed(scene), _FLUID_SPEED) / (2 * pi)
    return turns > MANY and _is_separated(scene)


def _speed(scene: Scene) -> float:
    """|ω| at the start, in shear rates."""
    return float(np.linalg.norm(scene.angular_velocity))


def _is_separated(scene: Scene) -> bool:
    """Whether ω changes little in a rotation at the start."""
    return _speed(scene) * _separation(scene) > _SEPARATED


def _separation(scene: Scene) -> float:
    """√(St I/8πX) of the strongest damping, in inverse shear rates; 0 at St = 0.

    A body at rest turns by an angle of order one in it.
    """
    return sqrt(scene.stokes / max(scene.ellipsoid.damping))


def _averaged_angle(scene: Scene) -> float | None:
    """∫⟨|ω|⟩ dt in rad along the averaged slow variables; None where they do not apply."""
    # Gauss's and Legendre's quadrature in s, t₂ = τ (exp(s) - 1), τ the fastest damping time: it resolves
    # both the transient and a long rest. Its nodes and weights belong to [-1, 1]. `span` is the end of s,
    # and dt₂ = τ exp(s) ds stands in the sum. St makes t of t₂.
    if isinf(scene.stokes):
        return scene.time * float(mean_speed(scene.ellipsoid, scene.initial.slow)[0])
    form = find_form(averaged_form(scene))
    try:
        problem = form.problem(scene)
    except ValueError:
        return None
    fastest = 1 / max(scene.ellipsoid.damping)
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    span = np.log1p(problem.end / fastest)
    s = span * (node + 1) / 2
    times = np.concatenate([[0.0], fastest * np.expm1(s)])
    run = solve(
        problem,
        available_like("cyrk-vern8"),
        _AVERAGED_TOLERANCE,
        times,
        max_steps=_MAX_AVERAGED_STEPS,
    )
    if not run.success:
        return None
    observed = form.observe(scene, run.states[1:])
    speed = mean_speed(scene.ellipsoid, observed.slow)
    turns_back = np.sum(observed.angular_momentum[1:] * observed.angular_momentum[:-1], axis=1) < 0
    pinched = np.any(turns_back) or np.min(speed) * _separation(scene) < _SEPARATED
    # L passes near zero, as it turns back from a node to the next or the body is slow. A full run
    # knows better there, if there can be one: without an orientation there is none.
    if pinched and not isinstance(scene.start, SlowStart):
        return None
    return scene.stokes * float(np.sum(weight * speed * fastest * np.exp(s))) * span / 2


def _with_angle(full: Problem, with_angle: Callable[[Factory], WithRate]) -> Problem:
    """The problem with the angle turned as one more component, before the time if that is one.

    The angle begins at 0. `with_angle` makes the field with the angle from the form's own.
    """
    field = full.field
    start = full.start
    if isinstance(field, AlongTrack):
        field = replace(field, field=with_angle(field.field))
        start = *start[:-1], 0.0, start[-1]
    else:
        field = with_angle(field)
        start = (*start, 0.0)
    return Problem(
        full.name, field, start, full.end, full.parameters, parameter_table=full.parameter_table
    )


def _angle(scene: Scene) -> float:
    """∫|ω| dt in rad by a loose run of the full equations, and by averages behind it where they serve.

    From rest, or nearly so, a first run ends at `risen`, and a second one, also from the start, at `longest`.
    After each averages give the rest if they serve there, in shear alone. Else the rest is
    extrapolated. The angle is the last component of the state, or the one before the time where
    that is a component too. Raises ValueError if a run fails.
    """
    form = find_form(reference_form(scene))
    full = form.problem(scene)
    # The modules of the two forms that `reference_form` chooses between.
    module = jeffery if scene.stokes == 0 else quaternion
    problem = _with_angle(full, module.with_angle)
    damping = max(scene.ellipsoid.damping) * scene.torque_factor
    stiff = scene.stokes > 0 and damping > _STIFF_FROM
    if stiff:
        solver, tolerance = "cyrk-radau", _STIFF_TOLERANCE
        longest = min(scene.time, LONGEST_STIFF)
    else:
        solver, tolerance = "cyrk-vern8", _LOOSE_TOLERANCE
        speed = max(_FLUID_SPEED, _speed(scene))
        longest = min(scene.time, LONGEST_ROTATIONS * 2 * pi / speed)
    risen = longest if _is_separated(scene) else _RISEN * _separation(scene)
    angle = 0.0
    for end in (risen, longest) if 0 < risen < longest else (longest,):
        run = solve(problem, available_like(solver), tolerance, np.array([0.0, end / 2, end]))
        if not run.success:
            raise ValueError(
                f"rotations: the loose run ended with {run.status.value}: {run.message}"
            )
        # The angle at half of `end`, and at `end`.
        half, whole = run.states[1:, -1 - problem.timed].astype(float).tolist()
        angle = whole + (scene.time - end) * (whole - half) / (end / 2)
        if end == scene.time:
            break
        if scene.flow is not None:
            # No averages are known in other flows than shear.
            continue
        # In shear the state has no time: its last component is the angle, which the form does not
        # know.
        reached = start_from(scene.ellipsoid, form.observe(scene, run.states[-1:, :-1]))
        remaining = replace(scene, start=reached, time=scene.time - end)
        if _averages_well(remaining) and (further := _averaged_angle(remaining)) is not None:
            return whole + further
    return angle
