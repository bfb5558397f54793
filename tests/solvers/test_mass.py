"""Mass matrices of users' functions: algebraic equations of index 1 by IDA, all else by every solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp as scipys
from scipy.sparse import csr_matrix, eye_array

from oracle.accepting import accepting
from polhode import Problem, WorkPrecision, solve_ivp
from polhode.models.mass import mass_of


def robertson(t, y):
    slow, fast = 0.04 * y[0] - 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return [-slow, slow - fast, y[0] + y[1] + y[2] - 1]


def robertson_in_python(t, y):
    rates = np.zeros(3)
    rates[:] = robertson(t, y)
    return rates


def robertsons_end():
    explicit = lambda t, y: [*robertson(t, y)[:2], 3e7 * y[1] ** 2]  # noqa: E731
    return scipys(explicit, (0, 1e3), [1, 0, 0], "Radau", rtol=1e-9, atol=1e-13).y[:, -1]


@pytest.mark.parametrize("f", [robertson, robertson_in_python])
@pytest.mark.parametrize("mass", [[1, 1, 0], np.diag([1, 1, 0.0]), csr_matrix(np.diag([1, 1, 0]))])
@pytest.mark.parametrize("third", [0.0, 0.3])
def test_algebraic_equations_start_consistent_and_stay_so(f, mass, third):
    run = solve_ivp(f, (0, 1e3), [1.0, 0.0, third], mass=mass, atol=[1e-8, 1e-12, 1e-8])
    assert run.success
    assert run.y[:, 0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    assert run.y[:, -1] == pytest.approx(robertsons_end(), rel=1e-4)
    assert run.y.sum(axis=0) == pytest.approx(1.0, abs=1e-6)


def forced(t, y):
    return [-y[0], y[1] - y[0] ** 2 - np.cos(t)]


def forced_in_python(t, y):
    return [-y[0], y[1] - y[0] ** 2 - np.interp(np.cos(t), [-1, 1], [-1, 1])]


@pytest.mark.parametrize("f", [forced, forced_in_python])
def test_a_full_singular_mass_matrix(f):
    """y0' + y1' = -y0 with y1 = y0² + cos t: (1 + 2 y0) y0' = sin t - y0."""
    mass = np.array([[1.0, 1.0], [0.0, 0.0]])
    explicit = lambda t, y: (np.sin(t) - y) / (1 + 2 * y)  # noqa: E731
    run = solve_ivp(f, (0, 2), [1.0, 0.0], mass=mass, rtol=1e-9)
    start = run.y[:, 0]
    assert start.sum() == pytest.approx(1.0, abs=1e-9)
    exact = scipys(explicit, (0, 2), start[:1], rtol=1e-11, atol=1e-11).y[0, -1]
    assert run.y[:, -1] == pytest.approx([exact, exact**2 + np.cos(2)], abs=1e-6)
    back = solve_ivp(f, (2, 0), run.y[:, -1], mass=mass, rtol=1e-9)
    assert back.y[:, -1] == pytest.approx(start, abs=1e-4)


def linear(t, y):
    return [-y[0] + np.sin(t), -y[1]]


@pytest.mark.parametrize("mass", [np.array([[2.0, 1.0], [1.0, 3.0]]), [2.0, 3.0]])
def test_a_mass_that_has_an_inverse_is_taken_by_all(mass):
    full = np.diag(mass) if np.ndim(mass) == 1 else mass
    exact = scipys(
        lambda t, y: np.linalg.solve(full, linear(t, y)), (0, 2), [1, 1], rtol=1e-11, atol=1e-11
    )
    names = accepting(Problem.from_function(linear, [1.0, 1.0], 2.0, mass=mass))
    assert {"taylor", "radau", "ida", "cyrk-dop853"} <= set(names)
    for name in names:
        run = solve_ivp(linear, (0, 2), [1.0, 1.0], name, mass=mass, rtol=1e-8)
        assert run.y[:, -1] == pytest.approx(exact.y[:, -1], abs=1e-5), name
    given = solve_ivp(
        linear, (0, 2), [1.0, 1.0], "radau", mass=mass, rtol=1e-8, jacobian=-np.eye(2)
    )
    assert given.y[:, -1] == pytest.approx(exact.y[:, -1], abs=1e-5)


@pytest.mark.parametrize("name", ["taylor", "radau", "bdf", "cvode-bdf", "cyrk-radau"])
def test_solvers_without_algebraic_equations_refuse_by_name(name):
    words = rf"^solver '{name}': 'robertson' has algebraic equations.*use solver 'ida'"
    with pytest.raises(ValueError, match=words):
        solve_ivp(robertson, (0, 1), [1.0, 0.0, 0.0], name, mass=[1, 1, 0])


@pytest.mark.parametrize(
    ("mass", "words"),
    [
        ([1, 1], r"^mass: got \[1, 1\], expected the diagonal, 3 numbers"),
        ([1, 1, np.nan], "^mass: got .*nan"),
        ([0, 0, 0], "^mass: got zeros alone"),
        ("unit", "^mass: got 'unit'"),
    ],
)
def test_what_is_no_mass_is_refused(mass, words):
    with pytest.raises(ValueError, match=words):
        solve_ivp(robertson, (0, 1), [1.0, 0.0, 0.0], mass=mass)


@pytest.mark.parametrize("entry", [1e-14, np.nan])
def test_a_large_mass_has_no_entry_off_its_diagonal(entry):
    """Neither rounding nor a NaN hides one."""
    mass = eye_array(600, format="lil")
    mass[1, 0] = entry
    with pytest.raises(ValueError, match=r"^mass: got a matrix of 600 components"):
        mass_of(mass.tocsr(), 600)
    assert mass_of(eye_array(600), 600).shape == (600,)


def test_an_index_above_one_is_refused():
    with pytest.raises(ValueError, match=r"^solver 'ida': .*index above 1"):
        solve_ivp(lambda t, y: [y[1], y[2], y[0] - np.sin(t)], (0, 1), [0, 1, 0], mass=[1, 1, 0])


def test_a_study_of_algebraic_equations():
    problem = Problem.from_function(robertson, [1.0, 0.0, 0.0], 1e3, mass=[1, 1, 0])
    end = robertsons_end()
    study = WorkPrecision(
        problem,
        tolerances=(1e-4, 1e-6),
        samples=2,
        atol=1e-10,
        error="final",
        reference=np.array([[1, 0, 0], end]),
        quiet=True,
    )
    assert set(study.frame["solver"]) == {"ida"}
    assert (study.frame["error"] < 1e-2).all()
