"""The bodies and starts that the study of second order follows.

`cases.toml` beside this module lists them. `polhode.harness.averaging.second_order` runs them; the results
are on `reports/second-order`. Resonances of polhode and precession are explained in `docs/second-order.md`.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polhode.models import scenes
from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid

# Angles θ, φ, ψ in rad, and their rates in shear rates: any starts without symmetry. The first one turns against
# the paper's: its ω_z, in space axes, is negative, as the fluid's is, -1/2, while the paper's is positive. In the
# second one the body turns slowly: |ω| is 0.8, in the paper's starts and the first one it is 1.4 to 2.0.
_AGAINST = EulerStart((1.0, 0.3, 0.2), (-1.0, 0.5, -2.0))
_GENTLE = EulerStart((1.5, 2.0, 0.2), (0.6, 0.4, -0.3))
# Starts of the second order's cases by name: the paper's two, for its spheroid and for its ellipsoid, which
# differ in ψ̇, and the two above. Cases without one start with an angular velocity at the orientation TILTED.
NAMED_STARTS = {
    "paper": scenes.SPHEROID_START,
    "paper, ψ̇ = -1": scenes.PAPER_START,
    "against": _AGAINST,
    "gentle": _GENTLE,
}
# Quaternion (w, x, y, z), which `BodyStart` normalises: any one without symmetry.
TILTED = (0.8, 0.3, -0.4, 0.2)
# Powers of ten between the smallest and the largest St of a case: enough to fit a slope. An estimate.
_DECADES = 2
_STOKES_DIGITS = 3  # Significant digits of these St, so that tables show them as they are.
_TABLES = tomllib.loads(Path(__file__).with_name("cases.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Subject:
    """A body and a start, followed to one slow time at a range of Stokes numbers."""

    name: str  # of the start, as tables show it; the body is shown by `axes`
    semi_axes: Triple  # along x', y', z'; only their ratios count
    start: EulerStart | BodyStart
    slow_time: float  # duration in inverse shear rates, over St
    stokes: tuple[float, ...]  # increasing

    @property
    def axes(self) -> str:
        """The semi-axes as a:b:c."""
        return ":".join(f"{axis:g}" for axis in self.semi_axes)

    def scene(self, stokes: float) -> Scene:
        """The case at one St, whose duration, in inverse shear rates, is proportional to it."""
        return Scene(Ellipsoid(self.semi_axes), stokes, self.start, self.slow_time * stokes)


def _case(
    axes: Triple,
    slow_time: float,
    points: int,
    start: str = "",
    spin: Triple = (0, 0, 0),
    lowest: float = 4.0,
) -> Subject:
    """A case of the second order, at `points` St over two decades from 10^`lowest` on.

    `start` names one of NAMED_STARTS. Without it the body starts at TILTED, with `spin` as its angular
    velocity in body axes, in shear rates. At the usual lowest St, 1e4, orientations of runs away from resonances
    err by less than 1 rad, from which on their phase would be lost. The needle 1:1:10 starts at 10^4.5: with the
    paper's start it errs by more at 1e4.
    """
    exponents = np.linspace(lowest, lowest + _DECADES, points).tolist()
    name = start or f"ω = ({', '.join(f'{rate:g}' for rate in spin)})"
    body_start = NAMED_STARTS[start] if start else BodyStart(TILTED, (*spin,))
    return Subject(
        name,
        (*axes,),
        body_start,
        slow_time,
        tuple(float(f"{10**exponent:.{_STOKES_DIGITS}g}") for exponent in exponents),
    )


def _cases(table: str) -> tuple[Subject, ...]:
    """All cases of one table of the file; its keys are the arguments of `_case`."""
    return tuple(_case(**row) for row in _TABLES[table])


# Cases of the second order, by what their runs meet. Bodies, starts and slow times are examples, chosen once.
# No resonance of polhode and precession that shows in the errors.
AWAY = _cases("away")
# Runs chosen near resonances. `reports/second-order` says which ones each passes; some pass none that shows.
RESONANT = _cases("resonant")
# L² = 2EI₂, I₂ being the middle moment of inertia, which the form cannot cross: the study cuts the run before it.
CROSSING = _cases("crossing")
