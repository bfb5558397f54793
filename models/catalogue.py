"""The catalogue of forms: one line each; modules are imported on use."""

from typing import TYPE_CHECKING

from polhode.models.registry import Catalogue

if TYPE_CHECKING:
    from polhode.models.form import Form
    from polhode.models.scene import Scene

FORMS: "Catalogue[Form]" = Catalogue(
    "form",
    "polhode.models.form:Form",
    {
        "euler-angles": "polhode.models.forms.euler_angles:EulerAngles",
        "spheroid-angles": "polhode.models.forms.spheroid_angles:SpheroidAngles",
        "quaternion": "polhode.models.forms.quaternion:Quaternion",
        "spheroid-axis": "polhode.models.forms.spheroid_axis:SpheroidAxis",
        "tumbling": "polhode.models.forms.tumbling:Tumbling",
        "jeffery": "polhode.models.forms.jeffery:Jeffery",
        "euler-top": "polhode.models.forms.euler_top:EulerTop",
        "averaged": "polhode.models.forms.averaged:Averaged",
        "averaged-spheroid": "polhode.models.forms.averaged_spheroid:AveragedSpheroid",
        "averaged-second-order": "polhode.models.second_order.form:SecondOrder",
        "hybrid": "polhode.models.hybrid.form:Hybrid",
    },
)
form = FORMS.find


def reference_form(scene: "Scene") -> str:
    """Name of the full form that gives the whole orientation: references and counts of rotations use it."""
    return "jeffery" if scene.stokes == 0 else "quaternion"


def full_form(scene: "Scene") -> str:
    """Name of the form of the full equations to run where nothing speaks for another one."""
    if scene.stokes == 0:
        return "jeffery"
    return "quaternion" if scene.ellipsoid.kind == "triaxial" else "spheroid-axis"


def averaged_form(scene: "Scene") -> str:
    """Name of the form averaged to first order that takes the scene's shape."""
    return "averaged" if scene.ellipsoid.kind == "triaxial" else "averaged-spheroid"
