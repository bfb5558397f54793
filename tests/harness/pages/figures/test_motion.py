"""The particle is drawn where it is, and `polhode draw` writes the file that was asked for."""

from pathlib import Path

import numpy as np
import pytest
from commandline import Run
from scipy.spatial.transform import Rotation

from polhode.harness.api import solve
from polhode.harness.pages.figures.motion import TILT, TURN, body, tumbling


@pytest.mark.parametrize("semi_axes", [(1.0, 0.6, 0.3), (0.2, 0.2, 1.0)])
def test_the_outline_is_that_of_the_ellipsoid(semi_axes: tuple[float, float, float]):
    import matplotlib.pyplot as plt

    rotation = Rotation.from_quat(np.random.default_rng(1).normal(size=4)).as_matrix()
    drawing, axes = plt.subplots()
    body(axes, np.array(semi_axes), rotation)
    corners = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    plt.close(drawing)
    # The shadow of an ellipsoid reaches sqrt(d · A d) in each direction d, with A = Σ s² n nᵀ.
    right = np.array([np.cos(TURN), 0, -np.sin(TURN)])
    up = np.array([-np.sin(TILT) * np.sin(TURN), np.cos(TILT), -np.sin(TILT) * np.cos(TURN)])
    for angle in np.linspace(0, np.pi, 7):
        towards = np.cos(angle) * right + np.sin(angle) * up
        expected = np.linalg.norm(np.array(semi_axes) * (rotation @ towards))
        assert (corners @ [np.cos(angle), np.sin(angle)]).max() == pytest.approx(expected, rel=5e-3)


def test_a_spheroid_whose_form_knows_its_axis_alone_is_drawn():
    solution = solve(
        "spheroid", form="spheroid-axis", solver="cyrk-vern8", tolerance=1e-6, samples=3
    )
    drawing = tumbling(solution)
    assert len(drawing.axes) == 3
    assert all(np.isfinite(axes.collections[0].get_facecolor()).all() for axes in drawing.axes)


def test_the_command_writes_a_picture_or_refuses(here: Run, tmp_path: Path):
    assert here("draw", "paper", "--frames", 2, "--out", tmp_path / "two.svg").returncode == 0
    assert (tmp_path / "two.svg").read_text(encoding="utf-8").count("<svg") == 1
    shape, start = (
        "[shape]\nsemi_axes = [1.0, 0.8, 0.5]",
        "[start]\nangular_momentum = [0, 0, 1]\nenergy = 1.5",
    )
    (tmp_path / "slow.toml").write_text(
        f"stokes = 20\ntime = 5\n{shape}\n{start}\n", encoding="utf-8"
    )
    for arguments, words in (
        (["sphere", "--out", tmp_path / "x.png"], "a sphere"),
        (["paper", "--out", tmp_path / "x.jpg"], ".png, .svg, .pdf"),
        (
            ["slow.toml", "--out", tmp_path / "x.png"],
            "'slow.toml', a start by L and E alone, expected a particle",
        ),
        (
            ["paper", "--until", -1, "--out", tmp_path / "x.png"],
            "--until: got -1, expected a positive time",
        ),
        (
            ["paper", "--until", 1e9, "--out", tmp_path / "x.png"],
            "got 1e9, 8.0e7 rotations, expected at most 1e5",
        ),
    ):
        done = here("draw", *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert words in done.stderr
    assert not list(tmp_path.glob("x.*"))


FLOW = """stokes = 1.0
time = 5.0
[shape]
semi_axes = [1.0, 0.8, 0.5]
[start]
euler_angles = [1.0, 0.5, 0.2]
euler_rates = [0.1, 0.2, 0.3]
[flow]
gradient = [[{}, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, {}]]
"""


@pytest.mark.parametrize(("stretching", "said"), [(0.5, True), (0.0, False)])
def test_what_the_arrows_do_not_show_of_a_flow_is_said(
    here: Run, tmp_path: Path, stretching: float, said: bool
):
    scene = tmp_path / "scene.toml"
    scene.write_text(FLOW.format(-stretching, stretching), encoding="utf-8")
    done = here("draw", scene, "--out", tmp_path / "a.png")
    assert done.returncode == 0, done.stderr
    note = (
        "note: the arrows show the flow at z = 0; its gradient along z (A13, A23, A33) is not drawn"
    )
    assert done.stderr.splitlines() == [note] * said
