"""Scenes at the edges of what is accepted: Stokes numbers, shapes, rates and times of any size.

`python -m torture.edges SEED COUNT` in the folder `tests` solves each in a process of its own, and prints a
line for each that is not answered in time.
"""

import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from random import Random

from torture.fuzz import answered, warm

# Exponents of ten between which each quantity of a scene is drawn: of St and of the time, in inverse shear
# rates, nearly all that double precision holds; of the ratio of two semi-axes; of the angular velocity, in
# shear rates. The last two are estimates: wider than anyone is expected to ask for.
STOKES = (-300.0, 300.0)
ASPECT = (0.0, 6.0)
RATE = (-150.0, 30.0)
TIME = (-300.0, 300.0)
# Share of the scenes with extreme semi-axes of which the first two are equal; and share of all scenes with one
# extreme quantity alone.
SPHEROIDS = 0.3
ONE_EXTREME = 0.5
# What `solve` says, after a few seconds, of a run that is long.
ANNOUNCED = re.compile("^note: it (is expected to take|has hardly begun|has come to)", re.MULTILINE)
# How long an answer may take, in seconds of the processor. A run whose time is announced may take that.
# `solve` announces a long run after a few seconds.
SECONDS = 5.0

SCENE = """\
stokes = {stokes!r}
time = {time!r}
[shape]
semi_axes = {axes!r}
[start]
quaternion = {quaternion!r}
angular_velocity = {rates!r}
"""


def scenes(random: Random) -> Iterator[str]:
    """Scene files, whose quantities are uniform in their exponent; half of them have one extreme quantity alone."""
    while True:
        stokes, time, rate = (10 ** random.uniform(*range_) for range_ in (STOKES, TIME, RATE))
        axes = [10 ** random.uniform(*ASPECT) for _ in range(3)]
        if random.random() < SPHEROIDS:
            axes[1] = axes[0]
        if random.random() < ONE_EXTREME:
            # All others are such as scenes usually have.
            extreme = random.randrange(4)
            stokes = stokes if extreme == 0 else 10 ** random.uniform(-3, 6)
            time = time if extreme == 1 else 10 ** random.uniform(-1, 3)
            rate = rate if extreme == 2 else 10 ** random.uniform(-2, 1)
            axes = axes if extreme == 3 else [random.uniform(1.0, 3.0) for _ in range(3)]
        yield SCENE.format(
            stokes=stokes,
            time=time,
            axes=axes,
            quaternion=[random.gauss(0, 1) for _ in range(4)],
            rates=[rate * random.uniform(-1, 1) for _ in range(3)],
        )


def at_the_edges(seed: int, count: int, folder: Path) -> list[str]:
    """Complaints about that many scenes; the folder keeps the files of those complained about."""
    complaints = []
    for number, (text, _) in enumerate(zip(scenes(Random(seed)), range(count), strict=False)):
        place = Path(tempfile.mkdtemp(dir=folder))
        (place / "x.toml").write_text(text, encoding="utf-8")
        if complaint := answered(["solve", "x.toml"], place, SECONDS, ANNOUNCED):
            kept = folder / f"edge-{seed}-{number}.toml"
            kept.write_text(text, encoding="utf-8")
            complaints.append(f"{complaint}: polhode solve {kept}")
        shutil.rmtree(place)
    return complaints


def main() -> None:
    """Try that many scenes; exit code 1 if one is not answered in time."""
    seed, count = map(int, sys.argv[1:])
    folder = Path("../build/torture")
    folder.mkdir(parents=True, exist_ok=True)
    warm()
    complaints = at_the_edges(seed, count, folder)
    print(*complaints, f"{len(complaints)} complaints about {count} scenes", sep="\n")
    sys.exit(bool(complaints))


if __name__ == "__main__":
    main()
