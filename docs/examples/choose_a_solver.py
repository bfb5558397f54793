"""Choose a solver for a run of a million shear times: ask what it will cost, run it, and look whether that was true."""

from polhode import pick, solve
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

# A triaxial ellipsoid at St = 1e6, followed for a million inverse shear rates: one unit of slow
# time.
scene = Scene(
    Ellipsoid((1.0, 0.8, 0.5)),
    stokes=1e6,
    start=EulerStart((1.0472, 0.5236, 0.0), (1.0, 1.0, -1.0)),
    time=1e6,
)


def ask(want, error):
    """Print the three cheapest ways, and return the first."""
    found = pick(scene, error=error, want=want)
    print(f"{want}, error at most {error:g}: {found.rotations:.3g} rotations to follow")
    for row in found.ranking[:3]:
        low, high = row.seconds.low, row.seconds.high
        print(
            f"  {row.form}, {row.solver} at {row.tolerance:g}: {low:.2g} to {high:.2g} s; {row.reason}"
        )
    return found.ranking[0]


if __name__ == "__main__":
    # Where L and E go needs no orientation, and the averaged equations do not count rotations.
    best = ask("slow", 1e-3)
    fast = solve(scene, form=best.form, solver=best.solver, tolerance=best.tolerance)
    print(
        f"  run: {fast.status} in {fast.seconds:.2g} s; L_z ends at {fast.angular_momentum[-1, 2]:.4f}\n"
    )

    # The orientation itself has to be followed through every rotation.
    best = ask("orientation", 1e-1)
    full = solve(scene, form=best.form, solver=best.solver, tolerance=best.tolerance)
    print(
        f"  run: {full.status} in {full.seconds:.2g} s; L_z ends at {full.angular_momentum[-1, 2]:.4f}"
    )
    print(
        f"  largest difference of L_z along the two runs: {abs(full.frame()['Lz'] - fast.frame()['Lz']).max():.1e}"
    )
