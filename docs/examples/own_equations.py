"""Figures of the page on equations of one's own, from the page's own lines: `own_equations.py FOLDER`."""

import re
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from polhode.harness.pages.figures.style import BLUE, GREEN, INK, ORANGE, key, panels, ramp, save

PAGE = Path(__file__).parents[1] / "own-ode.md"
HEIGHT = 2.5  # Inches of a figure, its key left out.
# Lines that compute a study, which no figure shows: studies take longer than all else on the page.
STUDY = re.compile(r"^(?:study|look|by_rate)\..*\n", re.MULTILINE)


def results():
    """What the page's lines compute, by name."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names = {}
    exec(STUDY.sub("", "\n".join(blocks)), names)
    return names


def chemistry(axes, names):
    """Three concentrations, the second one enlarged."""
    run = names["kinetics"]
    axes.semilogx(run.t, run.y[0], color=BLUE, label="A")
    axes.semilogx(run.t, 1e4 * run.y[1], color=ORANGE, label="10⁴ B")
    axes.semilogx(run.t, run.y[2], color=GREEN, label="C")
    axes.set(xlabel="t", ylabel="concentration")


def front(axes, names):
    """Profiles at the requested times, each with its time beside its steepest place."""
    run = names["front"]
    x = names["x"]
    for time, profile, colour in zip(run.t, run.y.T, ramp(len(run.t)), strict=True):
        axes.plot(x, profile, color=colour)
        half_way = x[profile > 0.5][-1]
        axes.annotate(
            f"t = {time:g}", (half_way, 0.5), (6, 0), textcoords="offset points", color=INK
        )
    axes.set(xlabel="x", ylabel="u", xlim=(0, 1))


def oscillator(axes, names):
    """The displacement and the force."""
    axes.plot(names["oscillator"].t, names["oscillator"].y[0], color=BLUE, label="displacement")
    axes.plot(names["table"], names["force"], color=ORANGE, label="force")
    axes.set(xlabel="t")


def pendulum(axes, names):
    """The angle, its passages through zero, and the end."""
    run = names["swing"]
    times = np.linspace(0, run.t[-1], 1000)
    passages = run.t_events[0]
    axes.plot(times, run.sol(times)[0], color=BLUE, label="angle")
    axes.plot(passages, np.zeros(len(passages)), ".", color=INK, label="lowest point")
    axes.plot(run.t[-1], run.y[0, -1], "o", color=ORANGE, label="over the top")
    axes.set(xlabel="t", ylabel="angle in rad")


def circuit(axes, names):
    """Voltages before and behind the diode."""
    run = names["circuit"]
    axes.plot(run.t, 5 * np.sin(2 * np.pi * run.t), color=BLUE, label="source")
    axes.plot(run.t, run.y[1], "--", color=ORANGE, label="before the diode")
    axes.plot(run.t, run.y[0], color=GREEN, label="capacitor")
    axes.set(xlabel="t", ylabel="voltage")


def main(folder):
    """Draw the five figures."""
    names = results()
    folder.mkdir(parents=True, exist_ok=True)
    for draw in (chemistry, front, oscillator, pendulum, circuit):
        figure, grid = panels(1, 1, HEIGHT)
        axes = grid[0, 0]
        draw(axes, names)
        handles = axes.get_legend_handles_labels()[0]
        if handles:
            key(figure, handles, len(handles))
        name = f"own-{draw.__name__}"
        save(figure, folder, name)
        print(f"drawn: {folder / name}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "figures"))
