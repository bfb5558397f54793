"""Figures of the page on equations of one's own, from the page's own lines: `own_equations.py FOLDER`."""

import re
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

PAGE = Path(__file__).parents[1] / "own-ode.md"
# The study of the page's first lines takes longer than all that follows.
STUDY = re.compile(r"WorkPrecision\(\n.*?\n\)\.frame", re.DOTALL)


def results():
    """What the page's lines compute, by name."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names = {}
    exec(STUDY.sub("", "\n".join(blocks)), names)
    return names


def chemistry(axes, names):
    """Three concentrations, the second one enlarged."""
    run = names["kinetics"]
    for values, label in zip(run.y * [[1], [1e4], [1]], ("A", "10⁴ B", "C"), strict=True):
        axes.semilogx(run.t, values, label=label)
    axes.set(xlabel="t", ylabel="concentration")


def front(axes, names):
    """Profiles at the requested times."""
    run = names["front"]
    for time, profile in zip(run.t, run.y.T, strict=True):
        axes.plot(names["x"], profile, label=f"t = {time:g}")
    axes.set(xlabel="x", ylabel="u")


def oscillator(axes, names):
    """The displacement and the force."""
    axes.plot(names["oscillator"].t, names["oscillator"].y[0], label="displacement")
    axes.plot(names["table"], names["force"], label="force")
    axes.set(xlabel="t")


def pendulum(axes, names):
    """The angle, its passages through zero, and the end."""
    run = names["swing"]
    times = np.linspace(0, run.t[-1], 1000)
    axes.plot(times, run.sol(times)[0], label="angle")
    axes.plot(run.t_events[0], np.zeros(len(run.t_events[0])), ".", label="lowest point")
    axes.plot(run.t[-1], run.y[0, -1], "o", label="over the top")
    axes.set(xlabel="t", ylabel="angle in rad")


def circuit(axes, names):
    """Voltages before and behind the diode."""
    run = names["circuit"]
    axes.plot(run.t, 5 * np.sin(2 * np.pi * run.t), label="source")
    axes.plot(run.t, run.y[1], label="before the diode")
    axes.plot(run.t, run.y[0], label="capacitor")
    axes.set(xlabel="t", ylabel="voltage")


def main(folder):
    """Draw the five figures."""
    names = results()
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (chemistry, front, oscillator, pendulum, circuit):
        figure, axes = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
        draw(axes, names)
        figure.legend(fontsize=8, loc="outside right upper")
        path = folder / f"own-{draw.__name__}.png"
        figure.savefig(path, dpi=100)
        plt.close(figure)
        print(f"drawn: {path}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "figures"))
