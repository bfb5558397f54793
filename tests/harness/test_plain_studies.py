"""Studies of functions that run as plain Python, of large systems, and of runs backwards."""

import numpy as np
import pytest

from polhode import Problem, WorkPrecision

TABLE = np.linspace(0, 20, 400)
FORCE = 0.37 * np.cos(1.2 * TABLE)


def tabulated(t, y):
    return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1] + np.interp(t, TABLE, FORCE)]


def smooth(t, y):
    return [y[1], -y[0] + np.cos(t)]


def test_rows_say_plain_python_and_compiled_solvers_are_refused_with_the_reason():
    problem = Problem.from_function(tabulated, [1.0, 0.0], 4.0)
    study = WorkPrecision(problem, tolerances=(1e-4, 1e-6), samples=11, quiet=True)
    frame = study.frame
    refused = frame[frame["status"] == "refused"]
    assert {"taylor", "cyrk-dop853", "cyrk-radau"} <= set(refused["solver"])
    assert refused["message"].str.contains(r"np.interp\(t, TABLE, FORCE\)").all()
    assert refused["seconds"].isna().all()
    ran = frame[frame["status"] == "reached_end"]
    assert {"dop853", "radau", "lsoda", "cvode-bdf", "ida"} <= set(ran["solver"])
    assert (ran["runs_as"] == "plain Python").all()
    assert ran["known"].any()
    assert (ran["error"] < 1e-1).all()
    assert "compared with" in study.source
    study.best()


def test_named_solvers_that_refuse_are_rows_too(tmp_path):
    problem = Problem.from_function(tabulated, [1.0, 0.0], 1.0)
    study = WorkPrecision(problem, ["taylor", "dop853"], [1e-4], samples=3, quiet=True)
    assert study.frame["status"].tolist() == ["refused", "reached_end"]
    assert study.frame["runs_as"].iloc[1] == "plain Python"
    page = study.write(tmp_path).read_text(encoding="utf-8")
    assert "refused" in page


def test_rows_of_compiled_functions_say_so():
    problem = Problem.from_function(smooth, [1.0, 0.0], 2.0)
    study = WorkPrecision(problem, ["taylor", "dop853"], [1e-6], 21, quiet=True)
    assert set(study.frame["runs_as"]) == {"compiled"}


@pytest.mark.parametrize("f", [smooth, tabulated])
def test_studies_go_backwards(f):
    def mine(f, t_span, y0, t_eval, rtol, atol):
        from scipy.integrate import solve_ivp

        assert t_span == (3.0, 1.0)
        return solve_ivp(f, t_span, y0, t_eval=t_eval, rtol=rtol, atol=atol).y.T

    problem = Problem.from_function(f, [1.0, 0.0], 1.0, t_start=3.0)
    solvers = {"mine": mine, "dop853": "dop853", "cvode-adams": "cvode-adams"}
    frame = WorkPrecision(problem, solvers, [1e-6], samples=11, quiet=True).frame
    assert (frame["error"] < 1e-4).all(), frame[["solver", "status", "error", "message"]]
    assert frame["runs_as"].iloc[0] == "function"


def test_errors_of_a_reference_name_it():
    problem = Problem.from_function(smooth, [1.0, 0.0], 2.0)
    study = WorkPrecision(problem, ["dop853"], [1e-6], reference=lambda t: 1 / 0, quiet=True)
    with pytest.raises(ValueError, match=r"^reference: got ZeroDivisionError: division by zero"):
        _ = study.frame


def test_a_study_of_a_large_system_with_a_pattern():
    n = 210

    def heat(t, y):
        padded = np.concatenate([[0.0], y, [0.0]])
        return (n + 1) ** 2 * (padded[2:] - 2 * y + padded[:-2])

    start = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    rate = 4 * (n + 1) ** 2 * np.sin(np.pi / 2 / (n + 1)) ** 2
    problem = Problem.from_function(heat, start, 0.1, lband=1, uband=1)
    study = WorkPrecision(
        problem,
        ["cvode-bdf", "bdf", "lsoda"],
        [1e-4, 1e-6],
        samples=6,
        quiet=True,
        reference=lambda t: start * np.exp(-rate * t),
    )
    assert (study.frame["error"] < 1e-2).all()
    assert (study.frame["seconds"] < 0.5).all()
