"""Accuracy of the averaged forms: laws on planted errors, starts against the captions, errors against brute force."""

import csv
import json
from math import cos, log10, pi

import numpy as np
import pytest
from click.testing import CliRunner

from polhode.harness import accuracy as module
from polhode.harness.accuracy import Law, Measured, aligned_with_vorticity, laws, measure, statements, subjects
from polhode.harness.accuracy_page import as_json, as_text, write_page
from polhode.harness.cli import polhode
from polhode.models.catalogue import form as find_form
from polhode.models.rotation import angular_velocity_from_euler
from polhode.models.scene import Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

STOKES = (1e2, 1e3, 1e4, 1e5, 1e6)


def planted(constant: float, order: float, noise: float = 0.0) -> Law:
    factors = 10 ** (noise * np.random.default_rng(3).standard_normal(len(STOKES)))
    errors = tuple(constant / stokes**order * factor for stokes, factor in zip(STOKES, factors, strict=True))
    return Law("planted", "spheroid", "averaged-spheroid", STOKES, errors)


def rows(errors: dict[float, float], uncertainty: float = 1e-16, family: str = "spheroid") -> list[Measured]:
    return [
        Measured(
            f"a {family}",
            family,
            "averaged",
            (1, 1, 2),
            stokes,
            0.5,
            (error, error / 2, 0, 0),
            (1e-9,) * 4,
            uncertainty,
            24,
        )
        for stokes, error in errors.items()
    ]


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_a_planted_order_is_found(order: float):
    law = planted(30.0, order)
    assert law.order == pytest.approx(order, abs=1e-12)
    assert law.order_interval == pytest.approx((order, order), abs=1e-9)


def test_the_interval_covers_the_planted_order_and_is_the_textbooks():
    law = planted(30.0, 1.0, noise=0.05)
    low, high = law.order_interval
    assert low < 1 < high
    from scipy.stats import linregress, t

    line = linregress(np.log10(STOKES[1:]), np.log10(law.error[1:]))
    assert (high - low) / 2 == pytest.approx(t.ppf(0.975, 2) * line[4])


@pytest.mark.parametrize(
    ("target", "stokes", "source"),
    [(1.0, 1e2, "at most"), (1e-2, 3e3, "measured"), (1e-4, 3e5, "measured"), (1e-6, 3e7, "extrapolated")],
)
def test_the_stokes_number_that_an_error_needs(target: float, stokes: float, source: str):
    found = planted(30.0, 1.0).needed(target)
    assert found == (pytest.approx(stokes), source)


def test_an_error_that_rises_again_is_not_met_before():
    law = Law("bump", "spheroid", "averaged", (1e2, 1e3, 1e4, 1e5), (1e-3, 1e-5, 1e-2, 1e-4))
    stokes, source = law.needed(1e-3)
    assert (stokes, source) == (pytest.approx(10**4.5), "measured")


def test_errors_within_the_references_uncertainty_are_left_out():
    measured = rows({1e2: 1e-1, 1e3: 1e-2, 1e4: 1e-3, 1e5: 5e-4}, uncertainty=1e-4)
    (law,) = laws(measured)
    assert law.stokes == (1e2, 1e3)
    assert np.isnan(law.order)


@pytest.mark.parametrize("semi_axes", [(1.0, 1.0, 3.33), (1.0, 1.0, 0.3)])
def test_the_spheroids_phase_plane_starts_are_the_captions(semi_axes: tuple):
    """The sign of ψ̇₀ is the corrected one of the list of misprints."""
    shape = Ellipsoid(semi_axes)
    equatorial, _, axial = shape.inertia
    momentum, theta = -max(shape.inertia), pi / 4
    rates = (0.0, momentum / equatorial, momentum * cos(theta) * (1 / axial - 1 / equatorial))
    found = aligned_with_vorticity(shape, theta, 0.0, -1.0)
    assert found.angular_velocity == pytest.approx(angular_velocity_from_euler((theta, 0.0, 0.0), rates), abs=1e-15)


@pytest.mark.parametrize("semi_axes", [(1.0, 0.55, 0.3), (1.0, 0.95, 0.5)])
def test_the_ellipsoids_phase_plane_starts_are_the_captions(semi_axes: tuple):
    shape = Ellipsoid(semi_axes)
    momentum, theta = -max(shape.inertia), pi / 4
    i1, _, i3 = shape.inertia
    rates = (0.0, momentum / i1, momentum * cos(theta) * (1 / i3 - 1 / i1))
    found = aligned_with_vorticity(shape, theta, pi / 2, -1.0)
    assert found.angular_velocity == pytest.approx(angular_velocity_from_euler((theta, 0.0, pi / 2), rates), abs=1e-15)
    initial = Scene(shape, 1.0, found, 1.0).initial
    assert initial.angular_momentum[0] == pytest.approx([0.0, 0.0, momentum], abs=1e-15)


def test_the_papers_cases_are_all_there():
    names = [subject.name for subject in subjects()]
    assert len(names) == len(set(names)) == 14
    shapes = {subject.ellipsoid.semi_axes for subject in subjects()}
    assert {(1, b, c) for b in (0.55, 0.75, 0.95) for c in (0.5, 0.3)} <= shapes
    assert {(1, 1, kappa) for kappa in (2, 3.33, 0.5, 0.3)} <= shapes


@pytest.mark.parametrize("index", [0, 2])
def test_the_model_error_is_that_of_two_plain_runs(index: int, tmp_path, monkeypatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    subject = list(subjects())[index]
    scene = subject.scene(100.0)
    name = "averaged-spheroid" if subject.family == "spheroid" else "averaged"
    (found,) = (row for row in measure(subject, 100.0) if row.form == name)
    slow = []
    for form_name, solver in (("euler-angles", "cyrk-vern8"), (name, "cyrk-dop853")):
        form = find_form(form_name)
        problem = form.problem(scene)
        solution = solve(problem, solver, 1e-11, np.linspace(0, problem.end, module.SAMPLES))
        slow.append(form.observe(scene, solution.states).slow)
    plain = np.max(np.abs(slow[0] - slow[1]), axis=0) / max(scene.ellipsoid.inertia)
    assert found.model == pytest.approx(plain, rel=1e-6)
    assert 0 < found.solver_error < 1e-6 < found.model_error
    assert found.pieces >= 20


def test_the_second_order_goes_as_far_as_the_separatrix(tmp_path, monkeypatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    monkeypatch.setattr(module, "SAMPLES", 101)
    first, second = sorted(measure(list(subjects())[2], 1000.0), key=lambda row: row.form)
    assert (first.form, second.form) == ("averaged", "averaged-second-order")
    assert first.until == 0.5
    assert 0.045 < second.until < 0.049
    assert second.model_error < first.model_error


def test_statements_quote_the_measured_numbers():
    measured = rows({1e2: 0.25, 1e3: 0.025, 1e4: 0.0025, 1e5: 0.00025})
    measured += rows({1e2: 0.5, 1e3: 0.05, 1e4: 0.005, 1e5: 0.0005}, family="ellipsoid")
    spheroid, ellipsoid = statements(measured)
    assert "between 0.25 (a spheroid) and 0.25" in spheroid
    assert "1 % is met from St ≈ 2500 to 2500" in spheroid
    assert "between 0.05 (a ellipsoid)" in ellipsoid
    slow = rows({stokes: 1 / stokes**0.5 for stokes in STOKES})
    assert "0.50 in Lx (a spheroid)" in statements(slow)[-1]


def test_the_page_has_every_number(tmp_path):
    measured = rows({stokes: 30 / stokes for stokes in STOKES})
    page = write_page(measured, tmp_path, "polhode accuracy").read_text(encoding="utf-8")
    assert "3.0e-3" in page
    assert (tmp_path / "errors.png").stat().st_size > 10_000
    with (tmp_path / "errors.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [float(row["model_Lx"]) for row in table] == [30 / stokes for stokes in STOKES]
    assert "3e+03" in as_text(measured)
    data = as_json(measured)
    assert data["laws"][0]["order"] == pytest.approx(1)
    assert log10(data["laws"][0]["stokes_for"]["0.01"]["stokes"]) == pytest.approx(log10(3e3))


def test_the_command_prints_nothing_but_json(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "measure_all", lambda **options: rows({stokes: 30 / stokes for stokes in STOKES}))
    outcome = CliRunner().invoke(polhode, ["accuracy", "--json", "--out", str(tmp_path)])
    assert outcome.exit_code == 0
    assert len(json.loads(outcome.stdout)["errors"]) == len(STOKES)
    assert (tmp_path / "README.md").exists()
