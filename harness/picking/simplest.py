"""The simplest form for a scene: the fewest equations that answer the question exactly."""

from math import isinf
from typing import Literal

from polhode.models.catalogue import form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene

Want = Literal["slow", "orientation"]


def simplest(scene: Scene, want: Want) -> tuple[str, str]:
    """Smallest full form that answers a question about a scene.

    Averaged forms are approximations: whether one is good enough depends on the error asked for, and is not decided
    here.

    Parameters
    ----------
    scene : Scene
    want : {"slow", "orientation"}
        L and E, or the orientation.

    Returns
    -------
    name : str
        Catalogue name of the form.
    reason : str
        Why, in words.

    Raises
    ------
    ValueError
        If `want` is neither, or if the start has no orientation.
    """
    if want not in ("slow", "orientation"):
        raise ValueError(f"want: got {want!r}, expected 'slow' or 'orientation'")
    name, reason = _limit(scene) or _planar(scene) or _general(scene)
    form(name).check(scene)
    return name, reason


def _limit(scene: Scene) -> tuple[str, str] | None:
    if scene.stokes == 0:
        return "jeffery", "St = 0: the angular velocity follows from the orientation"
    if isinf(scene.stokes):
        return "euler-top", "St = inf: no torque, solved in closed form at any time"
    return None


def _planar(scene: Scene) -> tuple[str, str] | None:
    try:
        form("tumbling").check(scene)
    except FormNotValidError:
        return None
    return "tumbling", "planar start: a principal axis stays along the vorticity, one angle tells everything"


def _general(scene: Scene) -> tuple[str, str]:
    if scene.ellipsoid.kind == "triaxial":
        return "quaternion", "triaxial: all of the orientation matters, and no angle of the quaternion form is singular"
    if scene.ellipsoid.kind == "sphere":
        return "spheroid-axis", "sphere: L obeys a linear equation of its own, whatever the axis beside it does"
    return "spheroid-axis", "spheroid: the spin angle does not matter, and L and the symmetry axis have no singularity"
