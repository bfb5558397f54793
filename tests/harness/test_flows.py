"""Scenes in other flows than simple shear: files, solve, pick, events, restart, references, sweeps."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from commandline import Run

import polhode
from polhode.harness.commands.show import scene_text
from polhode.harness.ensembles.sweep import parse_sweep
from polhode.harness.references.reference import reference
from polhode.models.files.scene_file import parse_scene, scene_table
from polhode.models.flow import Flow
from polhode.models.scene import EulerStart, Scene
from polhode.models.shape import Ellipsoid

START = EulerStart((1.0, 0.5, 0.2), (1.0, 1.0, -1.0))
PLANAR = Scene(Ellipsoid((1.0, 0.8, 0.5)), 20.0, START, 60.0, Flow.planar(0.3))
TABLE = scene_table(PLANAR)


def test_a_scene_with_a_flow_is_the_same_from_its_file():
    text = scene_text(TABLE)
    assert "[flow]" in text
    assert parse_scene(tomllib.loads(text)) == PLANAR


def test_shear_has_no_key():
    shear = replace(PLANAR, flow=None)
    assert "flow" not in scene_table(shear)
    given = scene_table(shear) | {"flow": {"gradient": [[0, 1, 0], [0, 0, 0], [0, 0, 0]]}}
    assert parse_scene(given) == shear


@pytest.mark.parametrize(
    ("flow", "line"),
    [
        ({"gradient": [[1.0, 0, 0], [0, 0, 0], [0, 0, 0]]}, "flow.gradient: got the trace 1,"),
        ({"gradient": [[0.0, 1.0], [0, 0, 0], [0, 0, 0]]}, "flow.gradient[0]: got [0.0, 1.0], "),
        (
            {"gradient": [[float("nan"), 0, 0], [0, 0, 0], [0, 0, 0]]},
            "flow.gradient[0][0]: got nan",
        ),
        ({"gradeint": [[0.0, 1.0, 0.0]]}, "flow.gradeint: unknown key, expected one of gradient"),
        ({}, "flow: got neither"),
    ],
)
def test_what_is_wrong_with_a_flow_is_said_in_one_line(flow, line):
    with pytest.raises(ValueError, match="flow") as refusal:
        parse_scene(TABLE | {"flow": flow})
    assert str(refusal.value).startswith(line)
    assert "\n" not in str(refusal.value)


def test_solve_states_an_error_that_bounds_the_distance_from_the_reference():
    found = polhode.solve(PLANAR, error=1e-7, samples=101)
    known = reference(PLANAR, "quaternion", 101)
    assert known.slow_uncertainty < 1e-14
    apart = np.max(np.abs(found.observables.slow - known.observables.slow))
    assert apart / max(PLANAR.ellipsoid.inertia) < found.error.slow.high < 1e-6


def test_restart_goes_on_in_the_same_flow():
    whole = polhode.solve(PLANAR, error=1e-9)
    rest = whole.restart(20.0)
    assert rest.flow == PLANAR.flow
    again = polhode.solve(rest, error=1e-9)
    np.testing.assert_allclose(again.angular_momentum[-1], whole.angular_momentum[-1], atol=1e-8)
    np.testing.assert_allclose(again.rotation[-1], whole.rotation[-1], atol=1e-7)


def test_events_that_mean_something_in_shear_alone_say_so():
    found = polhode.solve(PLANAR, events=["lz", "separatrix"])
    for name, moments in found.events.items():
        assert len(moments.times), name
    with pytest.raises(ValueError, match=r"event 'settled': got the flow .* expected simple shear"):
        polhode.solve(PLANAR, events="settled")


@pytest.mark.parametrize("stokes", [0.0, 20.0, 1e4])
def test_pick_ranks_forms_that_hold_in_the_flow(stokes):
    scene = replace(PLANAR, ellipsoid=Ellipsoid((1.0, 1.0, 2.0)), stokes=stokes)
    ranking = polhode.pick(scene, 1e-6).ranking
    assert ranking
    for row in ranking:
        found = polhode.solve(
            scene, form=row.form, solver=row.solver, tolerance=row.tolerance, estimate=False
        )
        assert found.success, (row.form, row.solver)


def test_a_sweep_in_a_flow_has_full_equations_and_no_attractors():
    table = {
        "name": "extension",
        "title": "discs in axial extension",
        "shapes": [[1.0, 1.0, 0.3]],
        "stokes": [1e4],
        "slow_time": 0.01,
        "start": {"motion": "jeffery"},
        "flow": {"gradient": [list(row) for row in Flow.extension().gradient]},
        "particles": 40,
        "block": 40,
    }
    (ensemble,) = parse_sweep(table).ensembles
    assert ensemble.equations == "full"
    assert ensemble.attractors == ()
    (shear,) = parse_sweep({k: v for k, v in table.items() if k != "flow"}).ensembles
    assert "flow" not in shear.content
    assert "flow" in ensemble.content
    statistics = ensemble.run(0)
    assert statistics.as_record()
    drawn = ensemble.draw(0, 1)
    problem = ensemble.problem
    starts = drawn.states(ensemble.form, ensemble.ellipsoid)
    np.testing.assert_allclose(starts[0], problem.start, atol=1e-14)


def test_the_command_refuses_a_form_of_shear_in_one_line(here: Run, tmp_path):
    (tmp_path / "scene.toml").write_text(scene_text(TABLE), encoding="utf-8")
    done = here("solve", "scene.toml", "--form", "averaged", "--samples", "3")
    assert done.returncode == 2
    assert "not simple shear" in done.stderr
    assert "use 'quaternion'" in done.stderr
    assert here("solve", "scene.toml", "--samples", "3", "--tolerance", "1e-8").returncode == 0
