"""Model error of averaged forms, from pilots: at the scene's own St, or at smaller ones and extrapolated."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from math import log
from typing import Any

import numpy as np

from polhode.harness.answers.interval import Interval
from polhode.harness.picking.laws import WANTS
from polhode.harness.picking.pilot import Pilot, PilotFailedError, follow, form_ladder, samples_of
from polhode.harness.picking.refusals import Stage, UnfitError, apart
from polhode.harness.references.errors import Errors, errors
from polhode.models.catalogue import form as find_form, reference_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene

# Rotations per damping time below which there is nothing to average over.
LEAST_ROTATIONS = 0.3
# At few output times the largest error may be missed; at many it is met.
MISSED, MET = 0.5, 1.1
# Ratio of the two Stokes numbers that show how the error falls, the exponents believed, and what
# they may be off.
RATIO = 3.0
EXPONENTS = (0.5, 2.2)
OFF, FACTOR = 0.15, 2.0
# What a form says of its own error, over the true one, in nine of ten scenes at most, and the true
# one over it: of 80 random scenes 79 stay below, and 97.5 % below 0.85.
OVERSTATED, UNDERSTATED = 30.0, 1.0
# What makes averaging poor: L gets so small a share of its largest size, or L²/2EI₂ so close to 1.
PINCHED, NEAR = 0.1, 0.03


def own_estimate(form: Form, scene: Scene) -> dict[str, Interval]:
    """What a form says of its own errors; nothing where it says nothing."""
    if not hasattr(form, "estimate"):
        return {}
    said: Any = form.estimate(scene)  # pyright: ignore[reportAttributeAccessIssue]
    values = {want: float(getattr(said, want)) for want in WANTS}
    return {
        want: Interval(value, value / OVERSTATED, value * UNDERSTATED)
        for want, value in values.items()
    }


def model_errors(form: Form, pilot: Pilot) -> Mapping[str, Interval | None]:
    """Slow and orientation error of an averaged form's exact solution against the full one.

    The smaller one of what the form says itself and what pilots show; raises UnfitError or
    PilotFailedError for none.
    """
    said = own_estimate(form, pilot.scene)
    try:
        shown = _shown(form, pilot)
    except (UnfitError, PilotFailedError):
        if not said:
            raise
        return said
    return shown | {
        want: own
        for want, own in said.items()
        if not (other := shown[want]) or own.high < other.high
    }


def _shown(form: Form, pilot: Pilot) -> dict[str, Interval | None]:
    if pilot.scene.ellipsoid.kind == "sphere":
        # L obeys the averaged equation itself.
        return {"slow": Interval(0.0, 0.0, 0.0), "orientation": None}
    check_averaging(pilot)
    if pilot.gains["slow"].error == np.inf:
        raise UnfitError(
            "trial runs lost the motion, so that the model error is unknown", Stage.AVERAGING
        )
    if pilot.direct:
        return _measured(form, pilot)
    if not pilot.twin:
        raise UnfitError(
            "the start is too slow for rotations to be fast against damping", Stage.AVERAGING
        )
    near, ellipsoid = pilot.followed, pilot.scene.ellipsoid
    far = replace(near, stokes=near.stokes / RATIO, time=near.time / RATIO)
    at_near = errors(ellipsoid, form_ladder(form, near)[-1][1], _thinned(pilot.observables, form))
    at_far = errors(ellipsoid, form_ladder(form, far)[-1][1], _thinned(_tight(far), form))
    return {
        want: _interval(want, at_near, at_far, pilot.scene.stokes / near.stokes) for want in WANTS
    }


def check_averaging(pilot: Pilot) -> None:
    """Raise UnfitError for a scene that has nothing to average over."""
    rotations, damping = pilot.rotations, pilot.damping_times
    if pilot.scene.ellipsoid.kind != "sphere" and rotations < LEAST_ROTATIONS * damping:
        share, least = apart(rotations / damping, LEAST_ROTATIONS)
        small = "St is too small to average over rotations"
        raise UnfitError(
            f"{small}: {share} of them per damping time, expected at least {least}", Stage.AVERAGING
        )


def causes(form: Form, pilot: Pilot) -> list[str]:
    """What makes averaging poor on a scene, in words; empty where nothing in particular does."""
    scene = pilot.scene
    observables = form_ladder(form, scene)[-1][1]
    size = np.linalg.norm(observables.angular_momentum, axis=1)
    found = []
    if pilot.damping_times > 0 and pilot.rotations < 10 * pilot.damping_times:
        found.append(
            f"St is small, with {pilot.rotations / pilot.damping_times:.2g} rotations per damping time"
        )
    if size.min() < PINCHED * size.max():
        found.append("L nearly vanishes on the way (pinch point)")
    if scene.ellipsoid.kind == "triaxial":
        middle = scene.ellipsoid.inertia[scene.ellipsoid.order[1]]
        ratio = size**2 / (2 * middle * observables.energy)
        if ratio.min() < 1 < ratio.max():
            found.append("the run crosses L² = 2EI₂")
        elif np.min(np.abs(ratio - 1)) < NEAR:
            found.append("the run comes close to L² = 2EI₂")
    return found


def _measured(form: Form, pilot: Pilot) -> dict[str, Interval | None]:
    found = errors(
        pilot.scene.ellipsoid,
        form_ladder(form, pilot.scene)[-1][1],
        _thinned(pilot.observables, form),
    )
    intervals: dict[str, Interval | None] = dict.fromkeys(WANTS)
    for want, gain in pilot.gains.items():
        if (value := getattr(found, want)) is not None:
            # The pilot's last run is a hundred times tighter than the one whose error is known.
            own = gain.error / 10
            intervals[want] = Interval(value, max(0.0, MISSED * (value - own)), MET * value + own)
    return intervals


def _thinned(seen: Observables, form: Form) -> Observables:
    """Observables at the times of a form's pilot alone."""
    return seen[:: (len(seen.energy) - 1) // (samples_of(form) - 1)]


def _interval(want: str, near: Errors, far: Errors, gap: float) -> Interval | None:
    here, there = getattr(near, want), getattr(far, want)
    if here is None or there is None:
        return None
    low, high = EXPONENTS
    exponent = min(high, max(low, log(max(there, 1e-300) / max(here, 1e-300)) / log(RATIO)))
    value = here * gap**-exponent
    return Interval(value, value / FACTOR * gap**-OFF, value * FACTOR * gap**OFF)


@lru_cache(maxsize=100)
def _tight(scene: Scene) -> Observables:
    form = find_form(reference_form(scene))
    return form.observe(scene, follow(form, scene, 1e-8).states)
