"""Long runs: Ctrl-C keeps what is finished, memory does not grow, nothing is printed, angles stay wrapped."""

import os
import signal
import subprocess
import sys
import time
from math import pi

import numpy as np
import pytest
from scipy.integrate import _ode

from oracle.runs import SCENES
from polhode.models.catalogue import form
from polhode.models.scene import Scene
from polhode.solvers.solve import solve

PREAMBLE = """
import sys
from dataclasses import replace
import numpy as np
from polhode.models.catalogue import form
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import Interrupted, solve
scene = Scene(Ellipsoid((1.0, 0.8, 0.5)), 1e3, EulerStart((1.0, 0.5, 0.0), (1.0, 1.0, -1.0)), 1e7)
problem = form("quaternion").problem(scene)
"""

INTERRUPTED = """
times = np.concatenate([[0.0, 1.0], np.linspace(100.0, scene.time, 1000)])
for name, way in [argument.split(":") for argument in sys.argv[1:]]:
    options = {"count": True} if way == "count" else {"backend": way or None}
    solve(replace(problem, end=1.0), name, 1e-8, **options)
    print("running", flush=True)
    try:
        solve(problem, name, 1e-8, times, **options)
    except Interrupted as interrupted:
        solution = interrupted.solution
        print(name, len(solution.times) == len(solution.states) >= 2, np.isfinite(solution.states).all(), flush=True)
"""

CASES = ["dop853:", "cvode-bdf:", "cvode-bdf:numba", "ida:", "ida:numba", "taylor:"]
CASES += ["cyrk-vern8:", "cyrk-vern8:count"]
# Before SciPy 1.17 LSODA is Fortran, and prints of its own accord.
LSODA_PRINTS = hasattr(_ode.lsoda, "active_global_handle")
if not LSODA_PRINTS:
    CASES.append("lsoda:")


def test_ctrl_c_keeps_the_finished_rows():
    process = subprocess.Popen(
        [sys.executable, "-c", PREAMBLE + INTERRUPTED, *CASES],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for case in CASES:
        assert process.stdout.readline() == "running\n"
        time.sleep(0.1)
        began = time.perf_counter()
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == f"{case.split(':')[0]} True True\n"
        assert time.perf_counter() - began < 1.5
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 0
    assert errors == ""


GROWTH = """
import resource
def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
for argument in sys.argv[1:]:
    name, end = argument.split(":")
    end = float(end)
    times = lambda end: np.array([0.0, 0.25 * end, 0.5 * end, end])
    solve(problem, name, 1e-6, times(0.05 * end))
    before = memory()
    solution = solve(problem, name, 1e-6, times(end))
    print(name, solution.success, memory() - before, flush=True)
"""


def assert_bounded(*arguments: str):
    done = subprocess.run(
        [sys.executable, "-c", PREAMBLE + GROWTH, *arguments],
        capture_output=True,
        text=True,
        check=True,
    )
    for line in done.stdout.splitlines():
        name, success, megabytes = line.split()
        assert success == "True", name
        # Keeping what happens at every step would take as much for thousands of steps.
        assert float(megabytes) < 1.0, line
    assert len(done.stdout.splitlines()) == len(arguments)


def test_memory_does_not_grow_with_the_length_of_a_run():
    assert_bounded("taylor:1e5", "cyrk-vern8:2e5")


@pytest.mark.slow
def test_memory_does_not_grow_in_a_million_units_of_time():
    assert_bounded(
        "taylor:1e6",
        "cyrk-vern8:1e6",
        "cyrk-lsoda:2e5",
        "cyrk-bdf:2e5",
        "lsoda:5e4",
        "cvode-bdf:5e4",
        "ida:2e4",
    )


def test_angles_stay_wrapped_on_a_long_run():
    """A tolerance relative to an angle of thousands of radians would be worth little."""
    paper = SCENES["prolate"]
    scene = Scene(paper.ellipsoid, 1e4, paper.start, 5000.0)
    times = np.linspace(0.0, 5000.0, 2001)
    tumbling, quaternion = (form(name) for name in ("spheroid-angles", "quaternion"))
    solution = solve(tumbling.problem(scene), "cyrk-vern8", 1e-12, times)
    assert solution.success
    assert np.abs(solution.states[:, list(tumbling.problem(scene).periodic)]).max() < 150 * pi
    expected = quaternion.observe(
        scene, solve(quaternion.problem(scene), "cyrk-vern8", 1e-14, times).states
    )
    got = tumbling.observe(scene, solution.states)
    assert np.abs(got.rotation[:, 2] - expected.rotation[:, 2]).max() < 1e-7


QUIET = """
for name in ("cvode-adams", "ida"):
    solve(replace(problem, end=10.0), name, 1e-6, jacobian=None)
    solve(replace(problem, end=10.0), name, 1e-17)
def square(ops):
    return lambda y, p: (y[0] * y[0],)
from polhode.models.problem import Problem
for name in sys.argv[1:]:
    solve(Problem("blow-up", square, (1.0,), 2.0), name, 1e-6)
print("end")
"""


def test_nothing_is_printed_even_without_a_home():
    """heyoka says on standard output that it cannot write its cache, SUNDIALS that it will continue anyway."""
    environment = os.environ | {
        "HOME": os.devnull,
        "XDG_CACHE_HOME": os.path.join(os.devnull, "cache"),
    }
    environment.pop("POLHODE_CACHE", None)
    solvers = ["cvode-bdf", "ida", "taylor", "cyrk-lsoda"]
    if not LSODA_PRINTS:
        solvers.append("lsoda")
    done = subprocess.run(
        [sys.executable, "-c", PREAMBLE + QUIET, *solvers],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    assert (done.stdout, done.stderr) == ("end\n", "")


def test_the_cache_of_compiled_code_is_where_the_user_wants_it(tmp_path):
    environment = os.environ | {"POLHODE_CACHE": str(tmp_path / "here")}
    program = PREAMBLE + 'solve(replace(problem, end=1.0), "taylor", 1e-6)'
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)
    assert any((tmp_path / "here" / "heyoka").iterdir())
