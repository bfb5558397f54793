"""Every solver on equal footing: speed at equal error, what the interpreter costs, what `solve` itself costs."""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from polhode.harness.analysis.frames import frame, where
from polhode.harness.analysis.pareto import crossing, fastest, times_at_error
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import bracketed, duration, markdown, scientific
from polhode.harness.common.timing import seconds_of
from polhode.harness.pages.work_precision import save, work_precision_panels
from polhode.harness.studies.cost import FirstRun, rhs_seconds
from polhode.harness.studies.overhead import Overhead
from polhode.models.problem import Problem
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.contract import Backend

ERRORS = (1e-4, 1e-6, 1e-8)
STIFF, OSCILLATORY_FROM = 1e-4, 1.0
STARTS = 5
STIFF_SOLVERS = ("cyrk-radau", "cvode-bdf", "ida")


@dataclass(frozen=True)
class Measured:
    """Records of the three studies, the overheads, and the cold and warm first runs, and right-hand sides' costs."""

    solvers: Sequence[Record]
    spheroid: Sequence[Record]
    backends: Sequence[Record]
    overheads: Sequence[Overhead]
    first_runs: Mapping[str, tuple[FirstRun, FirstRun]]
    rhs_costs: Mapping[Backend, float]


def write_page(measured: Measured, folder: Path, command: str) -> Path:
    """Write the page, its figures and its data."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("solvers", "spheroid", "backends"):
        export(list(getattr(measured, name)), folder / f"{name}.jsonl")
    solvers, spheroid, backends = (frame(getattr(measured, name)) for name in ("solvers", "spheroid", "backends"))
    save(work_precision_panels(solvers, "slow_error", "slow error over $I_{max}$"), folder, "slow")
    records = [*measured.solvers, *measured.spheroid, *measured.backends]
    lines = [
        *header("Every solver on equal footing", command, records),
        "Times are minima of warm runs in interleaved order; at a named error they are interpolated between a method's "
        "own runs.",
        "",
        "![Wall time against slow error, one panel per St](slow.png)",
        "",
        "## What the libraries are worth",
        "",
        *_claims(solvers),
        "",
        "## Where Taylor's and Verner's method cross",
        "",
        "Taylor's method adapts its order to the tolerance, and a step costs the square of the order; Verner's has a "
        "fixed order, so that its steps shrink as the error falls. Below the error named here Taylor's "
        "method is the faster one.",
        "",
        _crossings(solvers),
        "## What the form is worth",
        "",
        "The prolate spheroid (0.5, 0.5, 1) by Taylor's method: time in the quaternion form over time in the form "
        "(L, p̂), at equal slow error.",
        "",
        _forms(spheroid),
        "## Time at equal slow error",
        "",
        *_times(solvers),
        "## What the interpreter and the Jacobian cost",
        "",
        "The same algorithms at tolerance 1e-6 with the right-hand side in plain Python, in numba, and in machine code "
        "without Python in the loop; implicit ones with exact Jacobians and with finite differences. One right-hand "
        f"side alone takes {', '.join(f'{duration(cost)} ({name})' for name, cost in measured.rhs_costs.items())}.",
        "",
        _backends(backends),
        "## What `solve` adds to the bare library call",
        "",
        "The paper's ellipsoid at St = 1e3, 201 samples, tolerance 1e-8, everything compiled; bare call and `solve` in "
        "turns, the minimum of each. Allowed: 5 % or 50 µs, whichever is more.",
        "",
        _overheads(measured.overheads),
        "## What a first run costs",
        "",
        "The paper's ellipsoid in processes of their own: importing the library, compiling with an empty cache (cold) "
        "and with the cache of the process before (warm). heyoka alone keeps compiled code on disk.",
        "",
        _first_runs(measured.first_runs),
        f"`polhode --help` takes {duration(startup_seconds())} from the shell, the minimum of {STARTS} starts.",
        "",
    ]
    page = folder / "README.md"
    page.write_text("\n".join(lines), encoding="utf-8")
    return page


def rhs_costs(problem: Problem) -> dict[Backend, float]:
    """Wall time of one right-hand side by every back end."""
    names: tuple[Backend, ...] = ("python", "numba", "compiled")
    return {name: rhs_seconds(problem, name) for name in names}


def startup_seconds() -> float:
    """Wall time, in seconds, of `polhode --help` in a process of its own: the minimum of some starts."""
    code = "from polhode.harness.cli import main; main(['--help'])"

    def start() -> None:
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)

    return min(seconds_of(start) for _ in range(STARTS))


def _claims(table: pd.DataFrame) -> list[str]:
    stiff = times_at_error(where(table, table["stokes"] == STIFF), 1e-6)
    winner, taylor = fastest(stiff, "quaternion", solvers=STIFF_SOLVERS), stiff.get(("quaternion", "taylor"))
    lines = []
    if winner and taylor:
        lines.append(
            f"- Stiff side, St = {STIFF:g}, slow error 1e-6: {winner[0]} takes {duration(winner[1])}, Taylor's method "
            f"{duration(taylor)}: {taylor / winner[1]:.0f} times as long."
        )
    for stokes in sorted({value for value in table["stokes"].astype(float) if value >= OSCILLATORY_FROM}):
        times = times_at_error(where(table, table["stokes"] == stokes), 1e-8)
        callback = fastest(times, "quaternion", libraries=("SciPy", "SUNDIALS"))
        if callback is None:
            lines.append(f"- Oscillatory side, St = {stokes:g}: no SciPy or SUNDIALS solver reaches 1e-8 in its time.")
            continue
        ratios = [
            f"{name} {callback[1] / times['quaternion', name]:.0f} times faster ({duration(times['quaternion', name])})"
            for name in ("taylor", "cyrk-vern8", "cyrk-dop853", "cyrk-lsoda")
            if ("quaternion", name) in times
        ]
        lines.append(
            f"- Oscillatory side, St = {stokes:g}, slow error 1e-8: the fastest of SciPy and SUNDIALS is {callback[0]} "
            f"with {duration(callback[1])}; {', '.join(ratios)}."
        )
    return lines


def _crossings(table: pd.DataFrame) -> str:
    rows = []
    for stokes in sorted(set(table["stokes"].astype(float))):
        runs = where(table, table["stokes"] == stokes)
        error = crossing(runs, "quaternion", "taylor", "cyrk-vern8")
        ratios = []
        for target in ERRORS:
            times = times_at_error(runs, target)
            taylor, verner = times.get(("quaternion", "taylor")), times.get(("quaternion", "cyrk-vern8"))
            ratios.append(f"{taylor / verner:.2f}" if taylor and verner else "–")
        rows.append([f"{stokes:g}", scientific(error) if error else "none", *ratios])
    header = ["St", "they cross at", *(f"taylor / cyrk-vern8 at {target:g}" for target in ERRORS)]
    return markdown(header, rows, right=range(1, 5))


def _forms(table: pd.DataFrame) -> str:
    rows = []
    for stokes in sorted(set(table["stokes"].astype(float))):
        runs = where(table, table["stokes"] == stokes)
        row = [f"{stokes:g}"]
        for target in (1e-6, 1e-8, 1e-10, 1e-12):
            times = times_at_error(runs, target)
            slow, quick = times.get(("quaternion", "taylor")), times.get(("spheroid-axis", "taylor"))
            row.append(f"{slow / quick:.2f}" if slow and quick else "–")
        rows.append(row)
    return markdown(["St", "1e-6", "1e-8", "1e-10", "1e-12"], rows, right=range(1, 5))


def _times(table: pd.DataFrame) -> list[str]:
    numbers = sorted(set(table["stokes"].astype(float)))
    lines = []
    for target in ERRORS:
        times = {stokes: times_at_error(where(table, table["stokes"] == stokes), target) for stokes in numbers}
        rows = [
            [solver, *(duration(times[stokes].get(("quaternion", solver))) for stokes in numbers)]
            for solver in SOLVERS
            if any(("quaternion", solver) in found for found in times.values())
        ]
        header = ["solver", *(f"St = {stokes:g}" for stokes in numbers)]
        lines += [f"Slow error {target:g}:", "", markdown(header, rows, right=range(1, len(header)))]
    return lines


def _backends(table: pd.DataFrame) -> str:
    rows = []
    for run in table.sort_values(by=["stokes", "solver", "backend", "jacobian"]).to_dict("records"):
        work = [("–" if value is pd.NA or value is None else str(int(value))) for value in (run["work.rhs_calls"],)]
        jacobian = "" if run["jacobian"] is pd.NA or run["jacobian"] is None else run["jacobian"]
        row = [f"{run['stokes']:g}", run["solver"], run["backend"], jacobian, duration(run["seconds"]), *work]
        error = run["slow_error"]
        size = scientific(error) if pd.isna(error) else bracketed(error, bool(run["slow_known"]))
        rows.append([*row, size, str(run["status"]).replace("_", " ")])
    header = ["St", "solver", "right-hand side", "Jacobian", "time", "calls", "slow error", "status"]
    return markdown(header, rows, right=(4, 5, 6))


def _first_runs(runs: Mapping[str, tuple[FirstRun, FirstRun]]) -> str:
    rows = [
        [name, duration(cold.library), duration(cold.compilation), duration(warm.compilation), duration(warm.run)]
        for name, (cold, warm) in runs.items()
    ]
    return markdown(["solver", "import", "compile, cold", "compile, warm", "run"], rows, right=range(1, 5))


def _overheads(overheads: Sequence[Overhead]) -> str:
    rows = [
        [
            one.solver,
            duration(one.bare),
            duration(one.solve),
            f"{one.seconds * 1e6:+.0f} µs",
            f"{one.seconds / one.bare:+.1%}",
            "yes" if one.allowed else "no",
        ]
        for one in overheads
    ]
    header = ["solver", "bare call", "solve", "difference", "share", "within 5 % or 50 µs"]
    return markdown(header, rows, right=range(1, 5))
