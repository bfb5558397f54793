"""Why a form does not follow a scene, in words that leave the form's name out."""

from math import inf

import numpy as np

from polhode.models.form import Form, FormNotValidError
from polhode.models.scene import Scene
from polhode.models.second_order.run import shorter


def why_unreached(form: Form, scene: Scene, refusal: FormNotValidError) -> str:
    """Why a form follows no part of a scene.

    Parameters
    ----------
    form : Form
    scene : Scene
    refusal : FormNotValidError
        What the form's `reach` raised: of a run that meets L² = 2EI₂, no more than that it does. The reason why
        the shortest part that `reach` tries will not do either is added.
    """
    moves = 0 < scene.stokes < inf and bool(np.any(scene.initial.angular_momentum))
    parts = list(shorter(scene)) if moves and scene.ellipsoid.kind == "triaxial" else []
    if not parts:
        return refusal.condition
    try:
        form.check(parts[-1])
    except FormNotValidError as shortest:
        return f"{refusal.condition}; even ended at t₂ = {parts[-1].slow_time:.3g}, {shortest.condition}"
    return refusal.condition
