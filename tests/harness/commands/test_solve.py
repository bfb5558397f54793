"""`polhode solve`: the file it writes, and what an interrupted run leaves."""

import os
import re
import signal
import subprocess
import time
import tomllib
from errno import ENOSPC
from importlib.util import find_spec
from math import inf
from pathlib import Path

import numpy as np
import pytest
from commandline import SCENE, SCRIPT, Run, runner
from scipy.spatial.transform import Rotation

from polhode.harness.commands.solve import solve
from polhode.harness.references.errors import errors
from polhode.harness.references.reference import reference
from polhode.models.files.scene_file import parse_scene, read_scene
from polhode.models.observables import Observables
from polhode.models.rotation import Triple, matrix_from_quaternion
from polhode.models.scenes import named_scene

# Nothing left open, so that nothing needs to be picked.
GIVEN = ("--form", "quaternion", "--tolerance", "1e-8", "--solver", "cyrk-vern8")
HEADER = "t,t2,Lx,Ly,Lz,E,R11,R12,R13,R21,R22,R23,R31,R32,R33"


class Table:
    """A CSV file of `polhode solve`: its cells as written, and as numbers."""

    def __init__(self, path: Path) -> None:
        header, *lines = path.read_text(encoding="utf-8").splitlines()
        assert header == HEADER
        self.cells = [line.split(",") for line in lines]
        assert all(len(row) == len(HEADER.split(",")) for row in self.cells)
        self.numbers = np.array(
            [[float(cell) if cell else np.nan for cell in row] for row in self.cells]
        )

    @property
    def observables(self) -> Observables:
        return Observables(
            self.numbers[:, 2:5], self.numbers[:, 5], self.numbers[:, 6:].reshape(-1, 3, 3)
        )


def scene_text(
    stokes: float,
    time: float,
    axes: Triple = (1.0, 0.8, 0.5),
    start: str = "euler_angles = [1.0, 0.5, 0.2]",
) -> str:
    if "_rates" not in start and "_velocity" not in start and "energy" not in start:
        start += "\nat_rest = true"
    return (
        f"stokes = {stokes}\ntime = {time}\n[shape]\nsemi_axes = {list(axes)}\n[start]\n{start}\n"
    )


@pytest.fixture
def solved(here: Run, tmp_path: Path):
    """The table that `polhode solve` makes of a scene file."""

    def solve(text: str, *arguments: object) -> Table:
        (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
        done = here("solve", "scene.toml", *arguments, "--out", "out.csv")
        assert (done.returncode, done.stdout) == (0, "")
        assert sorted(path.name for path in tmp_path.iterdir()) == [
            "out.csv",
            "out.csv.json",
            "scene.toml",
        ]
        return Table(tmp_path / "out.csv")

    return solve


@pytest.mark.parametrize(
    ("arguments", "slow", "orientation"),
    [
        ([], 1e-6, 1e-4),
        (["--form", "quaternion", "--solver", "taylor", "--tolerance", "1e-14"], 1e-11, 1e-9),
        (["--form", "euler-angles", "--solver", "cyrk-dop853", "--tolerance", "1e-12"], 1e-9, 1e-7),
    ],
    ids=["default", "taylor", "other form and solver"],
)
def test_the_manuals_scene_agrees_with_the_reference(
    here: Run, scene_file: Path, tmp_path: Path, arguments: list[str], slow, orientation
):
    assert (
        here("solve", "scene.toml", *arguments, "--samples", 101, "--out", "out.csv").returncode
        == 0
    )
    table = Table(tmp_path / "out.csv")
    scene = read_scene(scene_file)
    true = reference(scene, "quaternion", 101)
    assert true.slow_uncertainty < slow / 10
    found = errors(scene.ellipsoid, table.observables, true.observables)
    assert found.slow <= slow
    assert found.orientation is not None
    assert found.orientation <= orientation


def test_rows_times_and_digits(solved):
    table = solved(SCENE, *GIVEN, "--samples", 7)
    assert len(table.cells) == 7
    times = table.numbers[:, 0]
    assert times[0] == 0
    assert times[-1] == 500
    assert np.diff(times) == pytest.approx(500 / 6, rel=1e-14)
    assert table.numbers[:, 1] == pytest.approx(times / 1000, rel=1e-15)
    # 17 significant digits: writing what was read gives the same text, and no digit of a double is
    # lost.
    assert all(
        f"{number:.17g}" == cell
        for row, line in zip(table.numbers, table.cells, strict=True)
        for number, cell in zip(row, line, strict=True)
    )
    assert any(len(cell.lstrip("-0.").replace(".", "")) >= 17 for cell in table.cells[3])
    scene = parse_scene(tomllib.loads(SCENE))
    assert table.numbers[0, 2:6] == pytest.approx(scene.initial.slow[0], rel=1e-14)
    assert table.numbers[0, 6:] == pytest.approx(scene.initial.rotation[0].ravel(), abs=1e-15)


def test_slow_time_is_empty_at_st_0_and_0_at_st_inf(solved):
    at_rest = scene_text(0.0, 5.0)
    assert {
        row[1] for row in solved(at_rest, "--form", "jeffery", *GIVEN[2:], "--samples", 3).cells
    } == {""}
    top = scene_text(
        inf, 5.0, start="euler_angles = [1.0, 0.5, 0.2]\neuler_rates = [1.0, 1.0, -1.0]"
    )
    exact = ("--form", "euler-top", "--solver", "exact", "--tolerance", 1)
    assert {row[1] for row in solved(top, *exact, "--samples", 3).cells} == {"0"}


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_form_that_knows_the_symmetry_axis_fills_its_row_alone(solved, axis: int):
    a, b, c = (2.0 if i == axis else 1.0 for i in range(3))
    axes = (a, b, c)
    assert axes[axis] == 2.0
    start = "euler_angles = [1.0, 0.5, 0.2]\neuler_rates = [1.0, 1.0, -1.0]"
    table = solved(
        scene_text(50.0, 2.0, axes, start), "--form", "spheroid-axis", *GIVEN[2:], "--samples", 3
    )
    for row in table.cells:
        filled = [bool(cell) for cell in row[6:]]
        assert filled == [i == axis for i in range(3) for _ in range(3)]
    lengths = np.linalg.norm(table.numbers[:, 6 + 3 * axis : 9 + 3 * axis], axis=1)
    assert lengths == pytest.approx(np.ones(3), abs=1e-7)


def test_averaged_forms_leave_the_rotation_empty(solved):
    table = solved(SCENE, "--form", "averaged", *GIVEN[2:], "--samples", 3)
    assert all(cell == "" for row in table.cells for cell in row[6:])
    assert not np.isnan(table.numbers[:, :6]).any()


@pytest.mark.parametrize(
    ("arguments", "code", "note"),
    [
        (
            ["--form", "averaged", "--error", "1e-9"],
            1,
            "note: the requested error, 1e-9, was probably missed",
        ),
        (["--form", "averaged", "--error", "1e-9", "--quiet"], 1, ""),
        (["--form", "averaged"], 0, "note: the requested error, 1e-6, was probably missed"),
        (["--form", "averaged", "--error", "0.1"], 0, ""),
        ([*GIVEN, "--error", "1e-9"], 0, "note: the --tolerance given governs the run"),
        ([*GIVEN], 0, ""),
    ],
    ids=["averaged", "quiet", "no error given", "met", "tolerance and error", "tolerance"],
)
def test_an_error_that_was_given_and_is_not_confirmed_exits_with_1_beside_a_complete_file(
    here: Run, scene_file: Path, tmp_path: Path, arguments: list, code: int, note: str
):
    done = here("solve", "scene.toml", *arguments, "--samples", "3", "--out", "out.csv")
    assert done.returncode == code
    assert len(Table(tmp_path / "out.csv").numbers) == 3
    assert not (tmp_path / "out.csv.partial").exists()
    last = done.stderr.splitlines()[-1:]
    assert ("is not confirmed; the rows are complete" in "".join(last)) == (code == 1)
    noted = [
        line for line in done.stderr.splitlines() if line.startswith("note") and "R11" not in line
    ]
    assert len(noted) == bool(note)
    assert all(line.startswith(note) for line in noted)


def test_averaged_forms_start_from_l_and_e(solved):
    start = "angular_momentum = [0.1, 0.2, 0.3]\nenergy = 0.15"
    table = solved(
        scene_text(1000.0, 500.0, start=start), "--form", "averaged", *GIVEN[2:], "--samples", 3
    )
    assert table.numbers[0, 2:6] == pytest.approx([0.1, 0.2, 0.3, 0.15], rel=1e-15)


def permuted(order: tuple[int, int, int]) -> str:
    """The manual's scene with its body axes named in another order; an odd one turns the last axis round."""
    scene = parse_scene(tomllib.loads(SCENE))
    change = np.eye(3)[list(order)]
    change[2] *= np.linalg.det(change)
    rotation, velocity = change @ scene.initial_rotation, change @ np.array(scene.angular_velocity)
    x, y, z, w = Rotation.from_matrix(rotation.T).as_quat().tolist()
    assert matrix_from_quaternion(np.array([w, x, y, z])) == pytest.approx(rotation, abs=1e-14)
    axes = [(1.0, 0.8, 0.5)[i] for i in order]
    start = f"quaternion = {[w, x, y, z]}\nangular_velocity = {velocity.tolist()}"
    return scene_text(1000.0, 50.0, (axes[0], axes[1], axes[2]), start)


@pytest.mark.parametrize("order", [(1, 2, 0), (2, 0, 1), (1, 0, 2), (2, 1, 0)])
@pytest.mark.parametrize("form", ["quaternion", "averaged"])
def test_the_order_of_the_semi_axes_changes_neither_l_nor_e(
    solved, form: str, order: tuple[int, int, int]
):
    arguments = ["--form", form, "--solver", "cyrk-dop853", "--tolerance", "1e-14", "--samples", 6]
    as_given = solved(permuted((0, 1, 2)), *arguments).numbers[:, 2:6]
    otherwise = solved(permuted(order), *arguments).numbers[:, 2:6]
    assert otherwise == pytest.approx(as_given, abs=1e-11)


def test_built_in_scenes_go_by_name_and_files_come_first(here: Run, tmp_path: Path):
    done = here("solve", "paper", *GIVEN, "--samples", 2, "--out", "built-in.csv")
    assert done.returncode == 0
    (tmp_path / "paper").write_text(SCENE.replace("1000.0", "10.0"), encoding="utf-8")
    assert here("solve", "paper", *GIVEN, "--samples", 2, "--out", "file.csv").returncode == 0
    assert Table(tmp_path / "built-in.csv").numbers[-1, 0] == 500
    assert Table(tmp_path / "file.csv").numbers[-1, 0] == 5


def test_devices_are_written_to_and_stdout_holds_the_table_alone(
    polhode: Run, scene_file: Path, tmp_path: Path
):
    done = polhode("solve", "scene.toml", *GIVEN, "--samples", 3, "--out", "/dev/stdout")
    assert done.returncode == 0
    assert done.stdout.splitlines()[0] == HEADER
    assert len(done.stdout.splitlines()) == 4
    assert [path.name for path in tmp_path.iterdir()] == [scene_file.name]


@pytest.mark.parametrize("out", ["-", "/dev/stdout"])
def test_redirected_output_is_written_to_and_goes_on_where_it_stands(
    environment, scene_file: Path, out: str
):
    """As `(echo before; polhode solve … --out -) > table.csv` in a shell."""
    words = [SCRIPT, "solve", scene_file.name, *GIVEN, "--samples", "3", "--out", out]
    table = scene_file.with_name("table.csv")
    with table.open("w", encoding="utf-8") as file:
        file.write("before\n")
        file.flush()
        done = subprocess.run(
            words,
            cwd=scene_file.parent,
            env=environment,
            stdout=file,
            stderr=subprocess.PIPE,
            check=False,
            timeout=120,
        )
    assert done.returncode == 0, done.stderr
    before, header, *rows = table.read_text(encoding="utf-8").splitlines()
    assert (before, header, len(rows)) == ("before", HEADER, 3)
    assert sorted(path.name for path in scene_file.parent.iterdir()) == [
        scene_file.name,
        "table.csv",
    ]
    assert Path("/dev/stdout").is_symlink()


@pytest.mark.parametrize(
    ("scene", "form", "note"),
    [
        (
            "spheroid",
            "spheroid-axis",
            "knows the symmetry axis alone: R11 to R13, R21 to R23 stay empty; --form",
        ),
        (
            "paper",
            "averaged",
            "knows no orientation: R11 to R13, R21 to R23, R31 to R33 stay empty; --form",
        ),
        # No form knows more of a start by L and E.
        ("scene.toml", "averaged", "R31 to R33 stay empty\n"),
        ("paper", "quaternion", ""),
    ],
)
def test_what_stays_empty_is_said(here: Run, tmp_path: Path, scene: str, form: str, note: str):
    start = "angular_momentum = [0.1, 0.2, 0.3]\nenergy = 0.15"
    (tmp_path / "scene.toml").write_text(scene_text(1000.0, 500.0, start=start), encoding="utf-8")
    words = ("--form", form, *GIVEN[2:], "--samples", 2)
    done = here("solve", scene, *words, "--out", "a.csv")
    assert done.returncode == 0
    assert note in done.stderr
    assert ("stay empty" in done.stderr) == bool(note)


def test_a_link_stays_and_what_it_points_to_is_replaced(
    here: Run, tmp_path: Path, scene_file: Path
):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "a.bin").write_text("old\n", encoding="utf-8")
    (tmp_path / "a.csv").symlink_to("there/a.bin")
    assert here("solve", scene_file.name, *GIVEN, "--samples", 3, "--out", "a.csv").returncode == 0
    assert (tmp_path / "a.csv").is_symlink()
    assert (tmp_path / "there" / "a.bin").read_text(encoding="utf-8").startswith(HEADER)
    assert sorted(path.name for path in (tmp_path / "there").iterdir()) == ["a.bin", "a.bin.json"]


@pytest.mark.parametrize(("out", "code"), [(os.devnull, 0), ("/dev/full", 1)])
def test_where_the_time_went_is_said_on_request(polhode: Run, out: str, code: int):
    done = polhode("solve", "paper", "--verbose", "--quiet", "--out", out)
    assert (done.returncode, done.stdout) == (code, "")
    lines = [line.rsplit(maxsplit=2)[0] for line in done.stderr.splitlines()]
    assert {"import", "compilation", "integration", "output", "in all"} <= set(lines)


def test_a_home_that_cannot_be_written_changes_nothing(environment, scene_file: Path):
    words = [SCRIPT, "solve", scene_file.name, *GIVEN, "--samples", "3", "--out", "/dev/stdout"]
    surroundings = {**environment, "HOME": "/proc", "XDG_CACHE_HOME": "/proc"}
    done = subprocess.run(
        words,
        cwd=scene_file.parent,
        env=surroundings,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(HEADER)
    assert len(done.stdout.splitlines()) == 4


def test_a_full_disk_is_a_failed_run(here: Run, scene_file: Path):
    done = here("solve", scene_file.name, *GIVEN, "--samples", 3, "--out", "/dev/full")
    assert done.returncode == 1
    assert "/dev/full: No space left on device" in done.stderr.splitlines()[-1]


def test_a_failed_run_leaves_its_rows_as_partial(here: Run, scene_file: Path, tmp_path: Path):
    # Euler angles through their pole: the run cannot reach its end.
    start = "euler_angles = [1e-4, 0.3, 0.2]\neuler_rates = [-1e-5, 0.0, 0.0]"
    scene_file.write_text(scene_text(1e6, 40.0, start=start), encoding="utf-8")
    (tmp_path / "out.csv").write_text("earlier", encoding="utf-8")
    done = here(
        "solve",
        "scene.toml",
        "--form",
        "euler-angles",
        *GIVEN[2:],
        "--samples",
        401,
        "--out",
        "out.csv",
    )
    assert done.returncode == 1
    line = done.stderr.splitlines()[-1]
    rows = Table(tmp_path / "out.csv.partial").numbers
    assert 1 < len(rows) < 401
    assert f"{len(rows)} of 401 rows are in out.csv.partial" in line
    assert line.startswith(("polhode: non_finite", "polhode: step_underflow"))
    assert np.isfinite(rows).all()
    assert (tmp_path / "out.csv").read_text(encoding="utf-8") == "earlier"


def test_ctrl_c_in_the_second_look_keeps_the_whole_run(
    scene_file: Path, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(*given: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("polhode.harness.answers.confirmed.confirmation", interrupted)
    out = scene_file.with_name("out.csv")
    found = runner().invoke(
        solve, [str(scene_file), *map(str, GIVEN), "--samples", "11", "--out", str(out)]
    )
    assert found.exit_code == 0, found.output
    assert len(Table(out).numbers) == 11
    assert "error: not known: not estimated" in found.stderr


def test_a_failed_run_at_a_loose_tolerance_is_to_be_tried_at_a_tighter_one(here: Run):
    done = here("solve", "paper", "--tolerance", "1")
    assert done.returncode == 1
    advice = done.stderr.rstrip().partition("do: ")[2]
    assert here("solve", "paper", *advice.split()).returncode == 0
    assert re.fullmatch(r"--tolerance \S+", advice)


def test_a_scene_is_not_overwritten_by_its_table(here: Run, tmp_path: Path):
    text = scene_text(1e3, 1.0)
    (tmp_path / "scene.txt").write_text(text, encoding="utf-8")
    done = here("solve", "scene.txt", "--out", "./scene.txt")
    assert done.stderr == "polhode: --out: got scene.txt, expected another file than the scene's\n"
    assert (done.returncode, (tmp_path / "scene.txt").read_text(encoding="utf-8")) == (2, text)


@pytest.mark.parametrize("solver", ["taylor", "cyrk-vern8"])
def test_ctrl_c_keeps_the_finished_rows(
    polhode: Run, environment, scene_file: Path, tmp_path: Path, solver: str
):
    start = "euler_angles = [1.0, 0.5, 0.2]\neuler_rates = [1.0, 1.0, -1.0]"
    scene_file.write_text(scene_text(1e8, 1e9, start=start), encoding="utf-8")
    words = [
        SCRIPT,
        "solve",
        "scene.toml",
        *GIVEN[:-1],
        solver,
        "--samples",
        "1000001",
        "--out",
        "out.csv",
    ]
    # Long enough to have compiled and finished rows, on a busy machine too.
    for patience in (0.8, 3.0, 12.0, 24.0):
        process = subprocess.Popen(
            words, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
        )
        time.sleep(patience)
        process.send_signal(signal.SIGINT)
        _, text = process.communicate(timeout=60)
        assert process.returncode == 1
        assert "Traceback" not in text
        assert not (tmp_path / "out.csv").exists()
        partial = tmp_path / "out.csv.partial"
        if not partial.exists() or not partial.read_text(encoding="utf-8"):
            continue
        rows = Table(tmp_path / "out.csv.partial").numbers
        if len(rows) > 1:
            break
    assert len(rows) > 1
    assert rows[:, 0] == pytest.approx(np.arange(len(rows)) * 1e3, rel=1e-12)
    assert np.isfinite(rows).all()
    note, *expectation, line = text.splitlines()
    assert note.startswith("quaternion by")
    # After three seconds, on a busy machine.
    assert [words[: len("note: it ")] for words in expectation] in ([], ["note: it "])
    assert line == f"polhode: interrupted: {len(rows)} of 1000001 rows are in out.csv.partial."
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv.partial", "scene.toml"]


def test_the_table_has_units_and_the_inertia_that_errors_are_shares_of(here: Run):
    done = here("solve", "paper", *GIVEN)
    assert done.returncode == 0
    table, _, words = done.stdout.partition("\n\n")
    assert len(table.splitlines()) == 1 + 11
    assert "t in 1/γ̇, L in ρ l⁵ γ̇, E in ρ l⁵ γ̇²" in words
    largest = max(named_scene("paper").ellipsoid.inertia)
    assert f"I_max = {largest:.6g} ρ l⁵" in words
    assert "of I_max" in done.stderr


def test_omega_parquet_and_a_scene_to_go_on(here: Run, tmp_path: Path):
    way = (
        "--form",
        "quaternion",
        "--solver",
        "cyrk-vern8",
        "--tolerance",
        "1e-10",
        "--samples",
        "3",
    )
    done = here("solve", "paper", *way, "--omega", "--out", "a.csv", "--restart", "next.toml")
    assert done.returncode == 0, done.stderr
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    assert header.endswith("R33,wx,wy,wz")
    again = here("solve", "next.toml", *way, "--omega", "--out", "b.csv")
    assert again.returncode == 0, again.stderr
    first = (tmp_path / "b.csv").read_text().splitlines()[1].split(",")
    end = rows[-1].split(",")
    assert [float(text) for text in first[2:]] == pytest.approx(
        [float(text) for text in end[2:]], abs=1e-12
    )
    if find_spec("pyarrow") is None:
        refused = here("solve", "paper", *way, "--out", "a.parquet")
        assert (refused.returncode, "expected pyarrow installed" in refused.stderr) == (2, True)


def test_a_run_expected_to_be_long_is_said_to_be(tmp_path: Path):
    scene = tmp_path / "long.toml"
    scene.write_text(
        "stokes = 1e5\ntime = 1e12\n[shape]\nsemi_axes = [3, 2, 1]\n"
        "[start]\nquaternion = [1, 0, 0, 0]\nangular_velocity = [0.1, 0.2, 0.3]\n"
    )
    command = [SCRIPT, "solve", str(scene)]
    way = ["--form", "quaternion", "--solver", "cyrk-dop853", "--tolerance", "1e-6"]
    running = subprocess.Popen([*command, *way], stderr=subprocess.PIPE, text=True)
    assert running.stderr
    with running, running.stderr:
        lines = []
        while not lines or not lines[-1].startswith("note: it"):
            lines.append(running.stderr.readline())
            assert lines[-1], lines
        running.kill()
    assert re.fullmatch(
        r"note: it is expected to take about \S+ s; Ctrl-C keeps what is finished\n", lines[-1]
    )


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("none/next.toml", "none: no such folder, expected an existing one"),
        ("./a.csv", "--restart: got a.csv, expected another file than a.csv and a.csv.json"),
        (
            "a.csv.json",
            "--restart: got a.csv.json, expected another file than a.csv and a.csv.json",
        ),
    ],
)
def test_a_scene_to_go_on_with_no_place_of_its_own_is_refused_before_the_run(
    here: Run, tmp_path: Path, file: str, reason: str
):
    done = here("solve", "paper", *GIVEN, "--out", "a.csv", "--restart", file)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"polhode: {reason}\n"
    assert not list(tmp_path.iterdir())


def test_the_scene_is_not_written_over(here: Run, tmp_path: Path):
    scene = tmp_path / "scene.toml"
    scene.write_text(text := scene_text(20.0, 5.0), encoding="utf-8")
    done = here("solve", "scene.toml", *GIVEN, "--restart", "./scene.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert (
        done.stderr
        == "polhode: --restart: got scene.toml, expected another file than the scene's\n"
    )
    assert scene.read_text(encoding="utf-8") == text


def test_a_scene_on_standard_output_is_alone_there(polhode: Run):
    done = polhode("solve", "paper", *GIVEN, "--restart", "-")
    assert tomllib.loads(done.stdout)["time"] == 500


def test_a_folder_in_the_place_beside_the_rows_is_refused_before_the_run(here: Run, tmp_path: Path):
    (tmp_path / "a.csv.json").mkdir()
    done = here("solve", "paper", *GIVEN, "--out", "a.csv")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "polhode: a.csv.json: is a folder, expected a file name\n"
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv.json"]


def test_a_full_disk_is_said_of_the_file_that_met_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def full(path: Path, content: str) -> None:
        raise OSError(ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr("polhode.harness.commands.solve.write_file", full)
    out = tmp_path / "a.csv"
    found = runner().invoke(
        solve, ["paper", *map(str, GIVEN), "--samples", "11", "--out", str(out)]
    )
    assert f"{out}.json: No space left on device, expected room" in found.stderr


@pytest.mark.parametrize("way", [["--form", "quaternion"], ["--solver", "taylor"], []])
def test_an_error_below_double_precision_is_refused_in_one_line(scene_file: Path, way: list[str]):
    found = runner().invoke(solve, [str(scene_file), "--error", "1e-20", *way])
    assert found.exit_code == 2
    assert "not attainable in double precision" in found.stderr


def test_a_track_that_ends_with_the_run_cannot_be_gone_on_along(tmp_path: Path):
    rows = "".join(f"{time},0,1,0,0,0,0,0.1,0,0\n" for time in (0, 3, 6))
    head = "t," + ",".join(f"A{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
    (tmp_path / "track.csv").write_text(f"{head}\n{rows}")
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'stokes = 2.0\ntime = 6.0\n[shape]\nsemi_axes = [3, 2, 1]\n[flow]\ntrack = "track.csv"\n'
        "[start]\nquaternion = [1, 0, 0, 0]\nangular_velocity = [0.1, 0.2, 0.3]\n"
    )
    words = [str(scene), "--samples", "3", "--restart", str(tmp_path / "next.toml")]
    found = runner().invoke(solve, words)
    assert found.exit_code == 2
    assert "--restart: got a track to t = 6, expected one to t = 12" in found.stderr
