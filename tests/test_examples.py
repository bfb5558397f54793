"""The examples run as they stand, and say what is true."""

import inspect
import json
import re
import runpy
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from commandline import SCRIPT, importing

from polhode.harness.common.store import read_export
from polhode.harness.site.sources import NAVIGATION
from polhode.models.catalogue import FORMS
from polhode.models.problems.catalogue import PROBLEMS
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Run an example in an empty folder and return its names and what it printed.

    `run(name, {text: shorter})` runs a copy with a shorter input in place of the text.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")

    def run(name: str, shorter: Mapping[str, str] = MappingProxyType({})) -> tuple[dict, str]:
        path = EXAMPLES / f"{name}.py"
        if shorter:
            program = path.read_text(encoding="utf-8")
            for text, instead in shorter.items():
                assert program.count(text) == 1
                program = program.replace(text, instead)
            path = tmp_path / path.name
            path.write_text(program, encoding="utf-8")
        names = runpy.run_path(str(path), run_name="__main__")
        return names, capsys.readouterr().out

    return run


def test_own_ode(example, tmp_path: Path):
    # The reference takes a run for each row.
    fewer = {"tolerances=(1e-4, 1e-6, 1e-8)": "tolerances=(1e-4, 1e-8), samples=21"}
    names, out = example("own_ode", fewer)
    assert (tmp_path / "brusselator.png").stat().st_size > 10_000
    frame = names["study"].frame
    assert {"taylor", "radau", "cyrk-vern8"} <= set(frame["solver"])
    tight = frame[(frame["tolerance"] == 1e-8) & (frame["status"] == "reached_end")]
    assert len(tight) > 5
    assert (tight["error"] < 1e-3).all()
    assert "reached_end" in out


def test_five_equations_of_the_page_and_their_figures(
    example, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("sys.argv", ["own_equations.py", str(tmp_path)])
    script, _ = example("own_equations")
    names = script["results"]()
    kinetics, front, swing = names["kinetics"], names["front"], names["swing"]
    assert kinetics.success
    assert kinetics.y.sum(axis=0) == pytest.approx(1.0, abs=1e-5)
    assert 3e-5 < kinetics.y[1].max() < 4e-5
    # Fisher's fronts move by 2 √D.
    places = [names["x"][profile > 0.5][-1] for profile in front.y.T]
    assert (places[-1] - places[-2]) / 8 == pytest.approx(0.02, rel=0.1)
    assert names["oscillator"].success
    assert abs(swing.y[0, -1]) == pytest.approx(3.14159265, abs=1e-6)
    assert len(swing.t_events[0]) > 10
    smooth, before = names["circuit"].y
    assert names["circuit"].success
    assert 3.5 < smooth.max() < before.max() < 5.0
    page = (EXAMPLES.parent / "own-ode.md").read_text(encoding="utf-8")
    shown = re.findall(r"\(figures/([\w-]+\.png)\)", page)
    assert sorted(shown) == sorted(path.name for path in tmp_path.glob("*.png"))
    assert all((EXAMPLES.parent / "figures" / name).exists() for name in shown)


def test_own_solver_is_of_order_four(example):
    _, out = example("own_solver")
    loose, middle, tight = (float(text) for text in re.findall(r"error ([\d.e+-]+)", out))
    assert loose / middle == pytest.approx(16, rel=0.5)
    assert middle / tight == pytest.approx(16, rel=0.5)


def test_own_solver_counts_its_right_hand_sides(example):
    names, _ = example("own_solver")
    times = np.linspace(0.0, 1.0, 3)
    problem = names["problem"]
    own = names["ClassicalRungeKutta"]()
    counted = names["solve"](problem, own, 1e-4, times, count=True).work
    assert counted.rhs_calls == 4 * counted.steps > 0
    assert names["solve"](problem, own, 1e-4, times).work.rhs_calls is None


def test_the_solver_of_the_page_counts_what_its_field_sees():
    page = (EXAMPLES.parent / "add-a-solver.md").read_text(encoding="utf-8")
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(block.replace("(1e-2, 1e-4)", "(1e-2, 1e-4), samples=21"), names)

    def decay(t, y):
        return [-y[0]]

    problem = names["Problem"].from_function(decay, [1.0], 1.0)
    times = np.linspace(0.0, 1.0, 5)
    solver = names["CountedEuler"]()
    found = solve(problem, solver, 1e-2, times, count=True)
    assert found.success
    assert found.work.rhs_calls == found.work.steps == 100
    assert np.abs(found.states[-1, 0] - np.exp(-1)) < 1e-2


def test_own_form_agrees_with_the_quaternion_form(example):
    _, out = example("own_form")
    loose, middle, tight = (float(text) for text in re.findall(r"error ([\d.e+-]+)", out))
    assert tight < 1e-10 < middle < 1e-7 < loose < 1e-3


def test_a_form_and_a_solver_of_ones_own_stand_in_the_tables(tmp_path: Path):
    words = [
        SCRIPT,
        "bench",
        str(EXAMPLES / "own_study.toml"),
        "--out",
        "own",
        "--quick",
        "--quiet",
    ]
    done = subprocess.run(
        words,
        cwd=tmp_path,
        env=importing(EXAMPLES),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (
        "note: the study runs code of own_form:Directions, own_solver:ClassicalRungeKutta"
        in done.stderr
    )
    runs = list(read_export(tmp_path / "own" / "records.jsonl.gz"))
    errors = {
        (run["form"], run["solver"]): run["slow_error"]
        for run in runs
        if run["status"] == "reached_end"
    }
    for form in ("quaternion", "own_form:Directions"):
        assert errors[form, "own_solver:ClassicalRungeKutta"] < 1e-6
        assert errors[form, "taylor"] < 1e-2
    assert (
        "own_form:Directions,own_solver:ClassicalRungeKutta"
        in (tmp_path / "own" / "runs.csv").read_text()
    )
    assert "own_form:Directions" in (tmp_path / "own" / "README.md").read_text()


def test_choose_a_solver(example):
    names, out = example("choose_a_solver")
    assert names["fast"].form.startswith("averaged")
    assert out.count("run: reached_end") == 2
    assert names["full"].times[-1] == names["fast"].times[-1] == pytest.approx(1e6)
    # What was asked of the averaged run.
    assert float(re.findall(r"two runs: ([\d.e+-]+)", out)[0]) < 1e-3 * max(
        names["scene"].ellipsoid.inertia
    )


def test_ice_crystal(example):
    names, out = example("ice_crystal")
    assert "inertia of the air matters" in out
    errors = [float(text) for text in re.findall(r"off by ([\d.e+-]+)", out)]
    stokes = [crystal.stokes for crystal in names["CRYSTALS"].values()]
    assert stokes == sorted(stokes)
    assert errors == sorted(errors, reverse=True)
    # 917 kg/m³ × 26/s × (100 µm)² / 1.67e-5 Pa s
    assert stokes[0] == pytest.approx(14.277, rel=1e-4)
    chosen = re.findall(r"1e-2: ([\w-]+) by", out)
    assert not chosen[0].startswith("averaged")


def test_many_shapes(example):
    names, out = example("many_shapes", {"count: int = 2000": "count: int = 200"})
    axes = names["AXES"]
    assert axes.shape == (200, 3)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, rtol=1e-9)
    means = [float(number) for number in re.findall(r"²> = (\S+)", out)]
    assert means == [round(float(mean), 2) for mean in np.mean(axes**2, axis=0)]
    # At large St the shortest axis ends along the vorticity.
    assert means[2] > 0.9


def test_turbulent_track(example, tmp_path: Path):
    # Three tracks tell the two rates apart as well as ten.
    names, out = example("turbulent_track", {"seed in range(10)": "seed in range(3)"})
    assert "fibre.toml: reached_end" in out
    assert names["FIBRE"].reynolds < 0.3
    # Inertia keeps a grain from following the fluid's fluctuations.
    assert 0.06 < names["RESULTS"]["fibre"] < 0.2
    assert names["RESULTS"]["grain"] < names["RESULTS"]["fibre"]
    gradients = names["turbulent_gradients"](np.linspace(0.0, 3000.0, 20_000), 5)
    strain = (gradients + gradients.swapaxes(1, 2)) / 2
    assert np.mean(np.sum(strain**2, axis=(1, 2))) == pytest.approx(0.5, rel=0.3)
    assert np.abs(np.trace(gradients, axis1=1, axis2=2)).max() < 1e-12
    assert (tmp_path / "track.csv").exists()


def test_every_example_is_run():
    run = set(re.findall(r'example\("(\w+)"', Path(__file__).read_text(encoding="utf-8")))
    assert run == {path.stem for path in EXAMPLES.glob("*.py")}


def test_references_name_every_method_form_and_problem():
    page = (EXAMPLES.parent / "references.md").read_text(encoding="utf-8")
    for name in (*SOLVERS, *FORMS, *PROBLEMS):
        assert f"- `{name}`: " in page, name
    for name in SOLVERS:
        source = re.search(
            r"Source: (.*?)(?:\n\n|\Z)", inspect.getdoc(type(solver(name))) or "", re.DOTALL
        )
        assert source is None or " ".join(source.group(1).split()) in page, name
    for each in PROBLEMS.values():
        assert each.source in page


def test_pages_show_python_that_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    readme = EXAMPLES.parents[1] / "README.md"
    scene = re.search(
        r"```toml\n(# ice\.toml\n.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL
    )
    assert scene
    (tmp_path / "ice.toml").write_text(scene[1], encoding="utf-8")
    own = ("add-a-solver.md", "own-ode.md", "quickstart.md", "scaling.md", "solutions.md")
    for page in (readme, *(EXAMPLES.parent / name for name in own)):
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        assert blocks
        # Three solvers and few rows say as much as all.
        code = "\n".join(blocks).replace(
            "tolerances=(1e-4, 1e-8)", "['taylor', 'radau', 'ida'], (1e-4,), samples=21"
        )
        code = re.sub(r"tolerances=\((1e-6,|1e-2, 1e-4)\)", r"\g<0>, samples=21", code)
        exec(code, {})


def test_the_navigation_names_every_page_of_the_docs():
    named = {page for pages in NAVIGATION.values() for page in pages if page.startswith("docs/")}
    # A page that does not exist is left out.
    there = {f"docs/{path.stem}" for path in EXAMPLES.parent.glob("*.md")}
    assert there - {"docs/paper_template"} <= named


def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    cells = json.loads((EXAMPLES / "tour.ipynb").read_text(encoding="utf-8"))["cells"]
    names: dict = {"__name__": "tour"}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert names["solution"].success
    assert names["problem"].name == "pendulum"
