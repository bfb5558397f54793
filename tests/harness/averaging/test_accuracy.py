"""Accuracy of the averaged forms: laws on planted errors, starts against the captions, errors against brute force."""

import csv
import json
import re
from math import log10
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from polhode.harness.averaging import measure as module
from polhode.harness.averaging.cases import Subject, paper_cases
from polhode.harness.averaging.data import (
    Absent,
    AveragingErrors,
    PaperStudy,
    read_study,
    write_study,
)
from polhode.harness.averaging.measure import measure
from polhode.harness.averaging.orders import Law, laws
from polhode.harness.cli import polhode
from polhode.harness.pages.averaging.first_order import (
    as_json,
    as_text,
    case_rows,
    law_rows,
    statements,
    write_page,
)
from polhode.harness.references.reference import reference
from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene
from polhode.models.second_order.form import SecondOrder
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

STOKES = (1e2, 1e3, 1e4, 1e5, 1e6)
HERE = {"date": "2026-05-04T03:02:01Z", "versions": {"polhode": "0.1.0"}}
HERE["machine"] = {"processor": "abacus", "cores": 1, "system": "wood", "python": "3.11"}


def study(errors: list[AveragingErrors], absent: tuple[Absent, ...] = ()) -> PaperStudy:
    return PaperStudy(errors, list(absent), {"errors": HERE})


def planted(constant: float, order: float, noise: float = 0.0) -> Law:
    factors = 10 ** (noise * np.random.default_rng(3).standard_normal(len(STOKES)))
    errors = tuple(
        constant / stokes**order * factor for stokes, factor in zip(STOKES, factors, strict=True)
    )
    return Law("planted", "spheroid", "averaged-spheroid", STOKES, errors, (0.5,) * len(STOKES))


def rows(
    errors: dict[float, float],
    uncertainty: float = 1e-16,
    family: str = "spheroid",
    form: str = "averaged",
    until: float = 0.5,
) -> list[AveragingErrors]:
    return [
        AveragingErrors(
            f"a {family}",
            family,
            form,
            (1, 1, 2),
            stokes,
            until,
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
    [
        (1.0, 1e2, "at most"),
        (1e-2, 3e3, "measured"),
        (1e-4, 3e5, "measured"),
        (1e-6, 3e7, "extrapolated"),
    ],
)
def test_the_stokes_number_that_an_error_needs(target: float, stokes: float, source: str):
    found = planted(30.0, 1.0).needed(target)
    assert found == (pytest.approx(stokes), source)


def test_an_error_that_rises_again_is_not_met_before():
    law = Law(
        "bump", "spheroid", "averaged", (1e2, 1e3, 1e4, 1e5), (1e-3, 1e-5, 1e-2, 1e-4), (0.5,) * 4
    )
    stokes, source = law.needed(1e-3)
    assert (stokes, source) == (pytest.approx(10**4.5), "measured")


def test_an_error_that_is_not_met_yet_is_not_met_before():
    """Though the fitted law lies below the last error."""
    law = Law(
        "bump", "ellipsoid", "averaged", (1e3, 1e4, 1e5, 1e6), (1e-1, 1e-3, 1e-4, 1e-4), (0.5,) * 4
    )
    assert law.needed(0.9e-4)[0] > 1e6


def test_nothing_is_known_of_an_error_that_grows():
    law = Law(
        "x", "ellipsoid", "averaged", (1e3, 1e4, 1e5, 1e6), (1e-3, 2e-3, 4e-3, 8e-3), (0.5,) * 4
    )
    assert np.isnan(law.needed(1e-3)[0])


def test_errors_within_the_references_uncertainty_are_left_out():
    measured = rows({1e2: 1e-1, 1e3: 1e-2, 1e4: 1e-3, 1e5: 5e-4}, uncertainty=1e-4)
    (law,) = laws(measured)
    assert law.stokes == (1e2, 1e3)
    assert np.isnan(law.order)


def test_three_points_tell_no_order_and_no_interval():
    three, four = (laws(rows({stokes: 30 / stokes for stokes in STOKES[1:n]}))[0] for n in (4, 5))
    assert np.isnan([three.order, *three.order_interval]).all()
    assert four.order == pytest.approx(1)
    measured = rows({1e3: 3e-2, 1e4: 3e-3, 1e5: 2.9e-3})
    assert law_rows(measured)[0]["St_fitted"] == 3
    assert case_rows(measured)[0]["first"] == "–"


def test_runs_that_end_early_tell_nothing_of_the_longest_horizon():
    """A shorter run errs less: with it the order would come out below 1 and the St for 5 % too small."""
    early = rows({316.0: 30 / 316 / 10}, form="averaged-second-order", until=0.02)
    late = rows(
        {stokes: 30 / stokes for stokes in STOKES[1:]}, form="averaged-second-order", until=0.03
    )
    late += rows({3e3: 30 / 3e3}, form="averaged-second-order", until=0.0299)
    (law,) = laws(early + late)
    assert len(law.stokes) == 6
    assert law.order == pytest.approx(1, abs=1e-12)
    assert law.needed(5e-2) == (1e3, "at most")
    (row,) = law_rows(early + late)
    assert [row[name] for name in ("to_t2", "St_from", "St_to", "St_fitted")] == [0.03, 1e3, 1e6, 5]
    (shown,) = case_rows(early + late)
    assert (shown["until"], shown["second_1e-02"], shown["first"]) == ("0.03", "3000", "–")


@pytest.mark.parametrize("case", paper_cases()[4:], ids=lambda case: case.name)
def test_the_phase_planes_starts_are_along_the_vorticity(case: Subject):
    initial, largest = case.scene(1.0).initial, max(Ellipsoid(case.semi_axes).inertia)
    assert initial.angular_momentum[0] == pytest.approx([0.0, 0.0, -largest], abs=1e-15 * largest)


def test_the_papers_cases_are_all_there():
    names = [subject.name for subject in paper_cases()]
    assert len(names) == len(set(names)) == 14
    shapes = {subject.semi_axes for subject in paper_cases()}
    assert {(1, b, c) for b in (0.55, 0.75, 0.95) for c in (0.5, 0.3)} <= shapes
    assert {(1, 1, kappa) for kappa in (2, 3.33, 0.5, 0.3)} <= shapes


def plain_or_certified(scene: Scene, form: Any, samples: int) -> Any:
    """A certified reference; of second order, whose compilation takes long, a plain run."""
    if not isinstance(form, SecondOrder):
        return reference(scene, form, samples)
    problem = form.problem(scene)
    found = solve(problem, "dop853", 1e-12, np.linspace(0, problem.end, samples))
    return SimpleNamespace(times=found.times, observables=form.observe(scene, found.states))


@pytest.mark.parametrize(("index", "stokes"), [(0, 100.0), (2, 1000.0)])
def test_the_model_error_is_that_of_two_plain_runs(
    index: int, stokes: float, tmp_path, monkeypatch
):
    """Second order goes as far as a small |L| or the separatrix, and errs less on its way."""
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    monkeypatch.setattr(module, "FORM_SAMPLES", 101)
    monkeypatch.setattr(module, "FORM_SOLVER", "dop853")
    monkeypatch.setattr(module, "reference", plain_or_certified)
    subject = paper_cases()[index]
    scene = subject.scene(stokes)
    (found, *second), absent = measure(subject, stokes)
    assert (second[0].form, absent) == ("averaged-second-order", [])
    assert 0.01 < second[0].until < 0.049
    assert second[0].model_error < found.model_error
    assert (found.form, found.until) == ("averaged-spheroid" if index == 0 else "averaged", 0.5)
    slow = []
    for form_name, solver in (("euler-angles", "cyrk-vern8"), (found.form, "cyrk-dop853")):
        form = find_form(form_name)
        problem = form.problem(scene)
        solution = solve(problem, solver, 1e-11, np.linspace(0, problem.end, module.FORM_SAMPLES))
        slow.append(form.observe(scene, solution.states).slow)
    plain = np.max(np.abs(slow[0] - slow[1]), axis=0) / max(scene.ellipsoid.inertia)
    assert found.model == pytest.approx(plain, rel=1e-6)
    assert 0 < found.solver_error < 1e-6 < found.model_error
    assert found.pieces >= 20


def test_statements_quote_the_measured_numbers():
    measured = rows({1e2: 0.25, 1e3: 0.025, 1e4: 0.0025, 1e5: 0.00025})
    measured += rows({1e2: 0.5, 1e3: 0.05, 1e4: 0.005, 1e5: 0.0005}, family="ellipsoid")
    spheroid, ellipsoid, order = statements(measured)
    assert "between 0.25 (a spheroid) and 0.25" in spheroid
    assert "1 % is met from St ≈ 2500 to 2500" in spheroid
    assert "between 0.05 (a ellipsoid)" in ellipsoid
    assert "First order" in order


def test_statements_hold_orders_to_what_averaging_promises():
    second = {"form": "averaged-second-order", "until": 0.05}
    noise = {1e3: 1.1, 1e4: 0.9, 1e5: 1.05, 1e6: 0.97}
    measured = rows({stokes: noise.get(stokes, 1) * 30 / stokes for stokes in STOKES})
    measured += rows(
        {stokes: factor * 1e3 / stokes**1.5 for stokes, factor in noise.items()},
        family="ellipsoid",
        **second,
    )
    measured += rows({stokes: 1e3 / stokes**2 for stokes in STOKES[:3]}, **second)
    first, spheroids, ellipsoids = statements(measured)[1:]
    assert "p = 1, which lies in the 95 % interval of p in 1 of 1 cases." in first
    assert spheroids == "Second order, spheroids: too few St for an order."
    assert (
        "p = 2, which lies in the 95 % interval of p in 0 of 1 cases, not in a ellipsoid (1."
        in ellipsoids
    )


def test_statements_name_the_variables_that_fall_slowly():
    slow = statements(rows({stokes: 1 / stokes**0.5 for stokes in STOKES}))[-1]
    assert "Lx of a spheroid (0.50), Ly of a spheroid (0.50)" in slow
    assert "Lz" not in slow


def test_data_come_back(tmp_path):
    measured = rows({stokes: 30 / stokes for stokes in STOKES}, uncertainty=1e-15 / 3)
    absent = (
        Absent("a, b", "ellipsoid", "averaged-second-order", 10**2.5, "refused: |L|, St = 316.228"),
    )
    write_study(study(measured, absent), tmp_path)
    assert read_study(PaperStudy, tmp_path) == study(measured, absent)


def test_the_page_answers_from_the_numbers(tmp_path):
    measured = rows({stokes: 30 / stokes for stokes in STOKES})
    write_page(
        study(measured, (Absent("a", "spheroid", "averaged", 1e2, "refused"),)),
        tmp_path,
        "polhode accuracy",
    )
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert re.search(
        r"\| a spheroid \| +3000 \| +– \| +3e5 \| +– \| 1.00 \(1.00 to 1.00\) \|", page
    )
    assert "Measured on 2026-05-04 on abacus" in page
    assert "(1 of 6), with the reason" in page
    assert (tmp_path / "errors.png").stat().st_size > 10_000
    tables = {}
    for name in ("errors", "laws"):
        with (tmp_path / f"{name}.csv").open(encoding="utf-8") as file:
            tables[name] = list(csv.DictReader(file))
    assert [float(row["model_Lx"]) for row in tables["errors"]] == [
        30 / stokes for stokes in STOKES
    ]
    assert float(tables["laws"][0]["St_for_0.01"]) == pytest.approx(3e3)
    assert "3000" in as_text(study(measured))
    law = as_json(study(measured))["laws"][0]
    assert law["order"] == pytest.approx(1)
    assert log10(law["St_for_0.01"]) == pytest.approx(log10(3e3))
    assert (law["from_0.01"], law["order_Lz"]) == ("measured", None)


def test_the_command_prints_nothing_but_json_and_the_page_alone_is_the_one_that_was_measured(
    tmp_path, monkeypatch
):
    measured = rows({stokes: 30 / stokes for stokes in STOKES})
    monkeypatch.setattr(module, "measure_all", lambda **options: study(measured))
    outcome = CliRunner().invoke(polhode, ["accuracy", "--json", "--out", str(tmp_path)])
    assert outcome.exit_code == 0
    assert len(json.loads(outcome.stdout)["errors"]) == len(STOKES)
    page = tmp_path / "README.md"
    before = page.read_text(encoding="utf-8")
    page.write_text("", encoding="utf-8")
    outcome = CliRunner().invoke(polhode, ["accuracy", "--page-only", "--out", str(tmp_path)])
    assert outcome.exit_code == 0
    assert page.read_text(encoding="utf-8") == before
    monkeypatch.chdir(tmp_path)
    assert (
        "reports/accuracy-quick/README.md"
        in CliRunner().invoke(polhode, ["accuracy", "--quick"]).stderr
    )


def test_a_page_without_data_is_refused(tmp_path):
    outcome = CliRunner().invoke(
        polhode, ["accuracy", "--page-only", "--out", str(tmp_path / "none")]
    )
    assert outcome.exit_code == 2
    assert (
        "errors.csv: No such file or directory, expected a table of case, family, form, a,"
        in outcome.output
    )
    assert not (tmp_path / "none").exists()
    (tmp_path / "errors.csv").write_text("a,b\n")
    outcome = CliRunner().invoke(polhode, ["accuracy", "--page-only", "--out", str(tmp_path)])
    assert outcome.exit_code == 2
    assert "got the columns a, b, expected case, family" in outcome.output
