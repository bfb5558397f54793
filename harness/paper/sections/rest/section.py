"""Section "Discussion": particles that start from rest."""

from polhode.harness.paper.item import Item, Section
from polhode.harness.paper.runs import spheroid
from polhode.harness.paper.sections.rest.spheres import Short, Sphere
from polhode.harness.paper.sections.rest.transient import Transient
from polhode.models.scene import EulerStart
from polhode.models.shape import Ellipsoid

NEEDLE = Sphere(spheroid(10.0), EulerStart((0.10472, 5.4978, 0.0)), 600.0)
BLADE = Sphere(Ellipsoid((0.1, 0.15, 1.0)), EulerStart((0.10472, 2.35619, 0.0)), 600.0)
SPHEROID_TRANSIENT = Transient(spheroid(2.0), EulerStart((0.314, 0.52, 0.0)))
ELLIPSOID_TRANSIENT = Transient(Ellipsoid((3.0, 2.0, 1.0)), EulerStart((0.314, 0.52, 1.05)))
SPHEROID_SHORT = Short(spheroid(2.0), EulerStart((0.78539, 2.35619, 0.0)))
ELLIPSOID_SHORT = Short(Ellipsoid((0.5, 0.55, 1.0)), EulerStart((0.78539, 2.35619, 0.0)))


SPIRAL = (
    "From rest at St = 1000 the axis first spirals along turns like Jeffery orbits towards the plane of the flow, then "
    "changes abruptly to an Euler spiral."
)
SCALING = (
    "Inertial effects set in after a time of O(St^½), the same for all St when scaled so, when the angular velocity is "
    "O(St^-½)."
)
LENGTH = (
    "Until t = St^½ the axis runs through a path whose length tends to a number of order one, and leaves the Jeffery "
    "orbit before a single turn."
)

SECTION = Section(
    "rest",
    "Starts from rest",
    (
        Item.of(NEEDLE, "rest-needle", "From rest on the unit sphere, spheroid", SPIRAL),
        Item.of(BLADE, "rest-blade", "From rest on the unit sphere, ellipsoid", SPIRAL),
        Item.of(SPHEROID_TRANSIENT, "rest-transient-spheroid", "The St^½ transient of a spheroid", SCALING),
        Item.of(ELLIPSOID_TRANSIENT, "rest-transient-ellipsoid", "The St^½ transient of an ellipsoid", SCALING),
        Item.of(SPHEROID_SHORT, "rest-short-spheroid", "From rest until St^½, spheroid", LENGTH),
        Item.of(ELLIPSOID_SHORT, "rest-short-ellipsoid", "From rest until St^½, ellipsoid", LENGTH),
    ),
)
