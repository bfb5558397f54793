"""Is the averaged solution good enough for my ice crystal? From physical units to a measured answer."""

from dataclasses import dataclass

from polhode import pick, solve
from polhode.harness.references.errors import errors
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

# Ice in air at 263 K, SI units; density and mean free path of the air at PRESSURE.
ICE, AIR, VISCOSITY, FREE_PATH, PRESSURE = 917.0, 1.34, 1.67e-5, 5.7e-8, 1.013e5
# The equations hold for Stokes flow of a continuum around the particle.
LARGEST_RE, LARGEST_KN = 0.1, 0.05


@dataclass(frozen=True)
class Crystal:
    """A spheroidal crystal in shear: semi-axes in m, the third along the symmetry axis; 1/s; Pa."""

    semi_axes: tuple[float, float, float]
    shear_rate: float
    pressure: float = PRESSURE

    @property
    def stokes(self) -> float:
        """St = ρ_particle γ̇ l²/μ, with the longest semi-axis l."""
        return ICE * self.shear_rate * max(self.semi_axes) ** 2 / VISCOSITY

    @property
    def reynolds(self) -> float:
        """Re = ρ_air γ̇ l²/μ."""
        return self.stokes * AIR * self.pressure / PRESSURE / ICE

    @property
    def knudsen(self) -> float:
        """Kn: the mean free path over the shortest semi-axis."""
        return FREE_PATH * PRESSURE / self.pressure / min(self.semi_axes)

    def doubts(self) -> list[str]:
        """Assumptions of the equations that do not hold."""
        return [f"Re = {self.reynolds:.2g}: inertia of the air matters"] * (
            self.reynolds > LARGEST_RE
        ) + [f"Kn = {self.knudsen:.2g}: the air slips along the crystal"] * (
            self.knudsen > LARGEST_KN
        )

    def scene(self, slow_time: float = 0.5) -> Scene:
        """The scene in polhode's units: lengths over l, times in inverse shear rates."""
        start = EulerStart((1.0472, 0.5236, 0.0), (1.0, 1.0, 1.0))
        return Scene(Ellipsoid(self.semi_axes), self.stokes, start, slow_time * self.stokes)


def model_error(scene: Scene) -> float:
    """Largest error of L and E along the run, over I_max, of the averaged equations: both solved far below it."""
    averaged = solve(scene, form="averaged-spheroid", solver="taylor", tolerance=1e-12)
    full = solve(scene, form="spheroid-axis", solver="taylor", tolerance=1e-12)
    return errors(scene.ellipsoid, averaged.observables, full.observables).slow


CRYSTALS = {
    "a column of 0.2 mm in a cloud": Crystal((25e-6, 25e-6, 100e-6), shear_rate=26.0),
    "a plate of 0.8 mm in a cloud": Crystal((400e-6, 400e-6, 100e-6), shear_rate=26.0),
    "a column of 0.8 mm in a jet at 10 hPa": Crystal(
        (200e-6, 200e-6, 400e-6), shear_rate=700.0, pressure=1e3
    ),
}

if __name__ == "__main__":
    for name, crystal in CRYSTALS.items():
        print(name)
        print(
            f"  St = {crystal.stokes:.3g}, Re = {crystal.reynolds:.2g}, Kn = {crystal.knudsen:.1g}"
        )
        for doubt in crystal.doubts():
            print(f"  beyond the equations, averaged or not: {doubt}")
        scene = crystal.scene()
        print(f"  the averaged equations are off by {model_error(scene):.1e} of I_max")
        best = pick(scene, error=1e-2).ranking[0]
        print(
            f"  for an error of 1e-2: {best.form} by {best.solver} at {best.tolerance:g}, {best.reason}"
        )
    print(f"in air of 1 bar, Re below {LARGEST_RE:g} means St below {LARGEST_RE * ICE / AIR:.0f}")
