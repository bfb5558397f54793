"""The catalogue of forms: one line each; modules are imported on use."""

from functools import cache
from typing import TYPE_CHECKING

from polhode.models.loading import load

if TYPE_CHECKING:
    from polhode.models.form import Form

FORMS: dict[str, str] = {
    "euler-angles": "polhode.models.euler_angles:EulerAngles",
    "spheroid-angles": "polhode.models.spheroid_angles:SpheroidAngles",
    "quaternion": "polhode.models.quaternion:Quaternion",
    "spheroid-axis": "polhode.models.spheroid_axis:SpheroidAxis",
    "tumbling": "polhode.models.tumbling:Tumbling",
    "jeffery": "polhode.models.jeffery:Jeffery",
    "euler-top": "polhode.models.euler_top:EulerTop",
    "averaged": "polhode.models.averaged:Averaged",
    "averaged-spheroid": "polhode.models.averaged_spheroid:AveragedSpheroid",
    "averaged-second-order": "polhode.models.second_order:SecondOrder",
}


@cache
def form(name: str) -> "Form":
    """Form of the given catalogue name, or of a ``"module:class"`` outside the catalogue.

    Raises
    ------
    ValueError
        If there is no form of that name.
    """
    from polhode.models.form import Form

    return load("form", name, FORMS, Form)
