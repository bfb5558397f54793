"""The command line: answers, and one clear line about whatever it cannot take."""

import json
import os
import re
import subprocess
import tomllib
from pathlib import Path

import click
import pytest
from commandline import SCENE, SCRIPT, Run

from polhode.harness.cli import COMMANDS, FORMER, GROUPS, polhode as commands
from polhode.harness.commands.show import scene_text
from polhode.harness.common.scene_words import written_slow_time
from polhode.models.catalogue import FORMS
from polhode.models.files.scene_file import parse_scene, scene_table
from polhode.models.scenes import SCENES, named_scene
from polhode.solvers.catalogue import SOLVERS

# What a folder holds when a scene file is all that there was: nothing half-written.
UNTOUCHED = ["scene.toml"]


def refusal(done: subprocess.CompletedProcess[str], folder: Path) -> str:
    """The one line of a refusal: exit code 2, nothing on stdout, nothing written."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("polhode")
    assert sorted(path.name for path in folder.iterdir()) == UNTOUCHED
    return done.stderr


def test_help_lists_every_command_in_its_group(polhode: Run):
    text = polhode("--help").stdout
    for title, group in GROUPS.items():
        listed = text.partition(f"{title}:\n")[2].partition("\n\n")[0].splitlines()
        assert [line.split()[0] for line in listed] == list(group)


def test_what_makes_the_reports_are_commands(monkeypatch: pytest.MonkeyPatch):
    root = Path(__file__).parents[2]
    monkeypatch.chdir(root)
    lines = (root / "reports" / "commands.txt").read_text().splitlines()
    for name, *options in map(str.split, lines):
        if name.endswith(".py"):
            assert (root / name).is_file()
        else:
            commands.get_command(click.Context(commands), name).make_context(name, options)
    pages = list(root.glob("reports/*/README.md"))
    assert len(pages) > 8
    for page in pages:
        made_by = re.search(r"Made by `(?:polhode|python) ([a-z_./-]+)", page.read_text())
        assert made_by, page
        assert made_by[1] in {line.split()[0] for line in lines}, page


@pytest.mark.parametrize("name", FORMER)
def test_former_names_are_understood_and_not_listed(here: Run, name: str):
    result = here(name, "--help")
    assert result.stdout.startswith(f"Usage: polhode {FORMER[name]} ")
    assert result.stderr.startswith(f"note: {name!r} is now {FORMER[name]!r}; the former name")
    assert f"  {name} " not in here("--help").stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_has_an_example(here: Run, command: str):
    done = here(command, "--help")
    assert done.returncode == 0
    assert f"Example: polhode {command}" in " ".join(done.stdout.split())


@pytest.mark.parametrize("command", ["forms", "solvers"])
def test_json_of_a_catalogue(here: Run, command: str):
    done = here(command, "--json")
    rows = json.loads(done.stdout)
    assert done.stderr == ""
    assert [row["name"] for row in rows] == list(FORMS if command == "forms" else SOLVERS)
    last = "valid_for" if command == "forms" else "accepts"
    assert all(list(row) == ["name", "summary", "available", "why_not", last] for row in rows)
    assert all(row["available"] is (row["why_not"] is None) for row in rows)
    assert all(row["name"] in here(command).stdout for row in rows[:1])


def test_shape_of_a_sphere_and_of_the_papers_ellipsoid(here: Run):
    sphere = json.loads(here("shape", 2, 2, 2, "--json").stdout)
    assert sphere["kind"] == "sphere"
    assert sphere["semi_axes"] == [2, 2, 2]
    assert sphere["inertia"] == pytest.approx(3 * [1.6755160819145565], rel=1e-15)
    assert sphere["resistance"] == pytest.approx([1, 1, 1], rel=1e-15)
    assert sphere["stokes_star_per_stokes"] == pytest.approx(1 / 15, rel=1e-15)
    paper = json.loads(here("shape", 1, 0.8, 0.5, "--json").stdout)
    assert (paper["kind"], paper["stokes_star_per_stokes"]) == ("triaxial", None)
    assert list(paper) == ["semi_axes", "inertia", "resistance", "kind", "stokes_star_per_stokes"]


@pytest.mark.parametrize(
    ("axes", "kind"), [((1, 1, 2), "prolate"), ((2, 1, 2), "oblate"), ((1, 1, 1e-70), "oblate")]
)
def test_shape_in_words(here: Run, axes: tuple[float, ...], kind: str):
    done = here("shape", *axes)
    assert done.stderr == ""
    table, _, words = done.stdout.partition("\n\n")
    header, *rows = table.splitlines()
    assert header.split() == ["x'", "y'", "z'", "unit"]
    assert [row.split("  ")[0] for row in rows] == ["semi-axis", "inertia I", "resistance X"]
    # Six digits are enough for people.
    assert max(len(word) for word in table.split()) <= len("1.23456e-100")
    assert words.startswith(f"kind: {kind}, St*/St = ")
    assert "nan" not in done.stdout


@pytest.mark.parametrize("name", SCENES)
def test_a_built_in_scene_printed_is_the_same_scene_as_a_file(name: str):
    scene = named_scene(name)
    for slow_time in (None, written_slow_time(name)):
        assert parse_scene(tomllib.loads(scene_text(scene_table(scene), slow_time))) == scene


def test_a_scene_keeps_the_slow_time_that_it_was_written_with(here: Run, tmp_path: Path):
    assert "\nslow_time = 0.5  # time / St; or: time = 500.0" in here("scenes", "paper").stdout
    assert "\ntime = 50.0  # in inverse shear rates; or" in here("scenes", "stiff").stdout
    text = here("scenes", "paper").stdout.replace("stokes = 1000.0", "stokes = 100000.0")
    (tmp_path / "ice.toml").write_text(text, encoding="utf-8")
    assert "slow_time = 0.5  # time / St; or: time = 50000.0" in here("scenes", "ice.toml").stdout


def test_scenes_are_listed_and_printed(here: Run, tmp_path: Path):
    rows = json.loads(here("scenes", "--json").stdout)
    assert [row["name"] for row in rows] == list(SCENES)
    assert all(row["time"] == SCENES[row["name"]].scene.time for row in rows)
    header, *lines = here("scenes").stdout.partition("\n\n")[0].splitlines()
    assert header.split() == ["name", "semi-axes", "St", "time", "summary"]
    assert [line.split()[0] for line in lines] == list(SCENES)
    assert lines[0].split()[:8] == ["paper", *["1", ":", "0.8", ":", "0.5", "1000", "500"]]
    assert "or: slow_time = 0.01, which is time / St" in here("scenes", "fast-spin").stdout
    (tmp_path / "mine.toml").write_text(here("scenes", "top").stdout, encoding="utf-8")
    shown = json.loads(here("scenes", "mine.toml", "--json").stdout, parse_constant=pytest.fail)
    assert shown == scene_table(named_scene("top")) | {"stokes": "Infinity"}


# Nothing left open, so that nothing needs to be picked.
GIVEN = ("--form", "quaternion", "--tolerance", "1e-8", "--solver", "taylor")
# Arguments, then what the line must say: the value, and what was expected.
BAD_ARGUMENTS = [
    ([], "Missing command", "(polhode --help lists the commands)"),
    (["shap"], "'shap' (did you mean 'shape'?)", "expected one of solve, pick"),
    (["sovle"], "'sovle'", "(did you mean 'solve'?)"),
    (["scenes", "papr"], "got 'papr' (did you mean 'paper'?), expected", "one of paper,"),
    (["completion", "tcsh"], "'tcsh'", "is not one of 'bash', 'zsh', 'fish'"),
    (["--frobnicate"], "--frobnicate", "expected: polhode [OPTIONS] COMMAND"),
    (["shape"], "got 0 numbers", "expected 3"),
    (["shape", "1", "2"], "got 2 numbers", "expected 3"),
    (["shape", "1", "2", "3", "4"], "got 4 numbers", "expected 3"),
    (["shape", "1", "-0.8", "0.5"], "got -0.8", "expected finite positive numbers"),
    (["shape", "-1", "-0.8", "-0.5", "--json"], "got -1.0", "expected finite positive numbers"),
    (["shape", "1", "nan", "0.5"], "got nan", "expected finite positive numbers"),
    (["shape", "1", "inf", "0.5"], "got inf", "expected finite positive numbers"),
    (["shape", "1", "0", "0.5"], "got 0.0", "expected finite positive numbers"),
    (["shape", "1", "one", "0.5"], "'one'", "is not a valid float"),
    (["shape", "1", "2", "3", "--jason"], "'--jason'", "is not a valid float"),
    (["shape", "1", "1e-80", "1"], "1e-80", "of at least 1e-70"),
    (["forms", "quaternion"], "(quaternion)", "expected: polhode forms [OPTIONS]"),
    (["solvers", "--jason"], "--jason", "? expected: polhode solvers"),
    (["solve"], "Missing argument 'SCENE'", "expected: polhode solve [OPTIONS] SCENE"),
    (["solve", "scene.toml", "--out"], "'--out'", "requires an argument"),
    (
        ["solve", "no-such-scene", "--out", "a.csv"],
        "got 'no-such-scene'",
        "expected a file or one of paper,",
    ),
    (["solve", "", "--out", "a.csv"], "got ''", "expected a file or one of paper,"),
    (
        ["solve", "sceen.toml", "--out", "a.csv"],
        "got 'sceen.toml' (did you mean 'scene.toml'?)",
        "expected a file or a built-in name of `polhode scenes`",
    ),
    (["bench", "sceen.toml"], "(did you mean 'scene.toml'?)", "expected an existing one"),
    (["bench", "--resume=3"], "'--resume' does not take a value", "expected: polhode bench"),
    (["solve", "..", "--out", "a.csv"], "got '..'", "a folder, expected a file"),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--form", "quarternion"],
        "got 'quarternion'",
        "expected one of euler",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--form", "os:path"],
        "got 'os:path'",
        "expected a class derived from",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--form", "nothing:at_all"],
        "'nothing:at_all'",
        "is its folder on PYTHONPATH?",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--form", "averaged-spheroid"],
        "[1.0, 0.8, 0.5]",
        "use 'averaged'",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--solver", "rk4"],
        "got 'rk4'",
        "expected one of taylor, dop853",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--solver", "vern8"],
        "got 'vern8' (did you mean 'cyrk-vern8'?)",
        "expected one of",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--sample", "3"],
        "--sample",
        "--samples",
    ),
    (["report", "--out", "scene.toml"], "--out", "Directory 'scene.toml' is a file"),
    (
        ["solve", "scene.toml", "--out", "a.csv", *GIVEN, "--solver", "exact"],
        "'quaternion'",
        "use solver 'taylor'",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--tolerance", "0"],
        "got 0.0",
        "expected a number from 1e-16",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--tolerance", "-1e-6"],
        "got -1e-06",
        "expected a number from",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--tolerance", "nan"],
        "got nan",
        "expected a number from",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--tolerance", "tight"],
        "'tight'",
        "is not a valid float",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--tolerance", "1e-30"],
        "got 1e-30",
        "expected a number from 1e-16",
    ),
    (["solve", "scene.toml", *GIVEN, "--out", "a.csv", "--tolerance", "3"], "got 3.0", "to 1"),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--form", "averaged", "--want", "orientation"],
        "got 'orientation' for form 'averaged'",
        "expected 'slow'",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--error", "-1"],
        "got -1.0",
        "expected a finite positive number",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--want", "all"],
        "'all'",
        "is not one of 'slow', 'orientation'",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--samples", "1"],
        "got 1,",
        "expected a whole number from 2 to",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--samples", "-5"],
        "got -5,",
        "expected a whole number from 2 to",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--samples", "1e12"],
        "'1e12'",
        "is not a valid integer",
    ),
    (
        ["solve", "scene.toml", "--out", "a.csv", "--samples", "1000000000000"],
        "1000000000000",
        "from 2 to 10000000",
    ),
    (
        ["solve", "scene.toml", "--out", "a.xlsx"],
        "got 'a.xlsx'",
        "in .csv, .txt, .dat, .parquet, or without",
    ),
    (["solve", "scene.toml", "--out", "."], ".: is a folder", "expected a file name"),
    (
        ["solve", "scene.toml", "--out", "no/such/a.csv"],
        "no/such: no such folder",
        "expected an existing one",
    ),
    (
        ["solve", "scene.toml", *GIVEN, "--out", "/proc/a.csv"],
        "/proc/a.csv",
        "expected an existing one",
    ),
    (
        ["solve", "scene.toml", "again", "--out", "a.csv"],
        "(again)",
        "expected: polhode solve [OPTIONS] SCENE",
    ),
    (["bench", "no-such-study.toml"], "no-such-study.toml", "expected an existing one"),
    (["bench", "scene.toml"], "scene.toml: stokes: unknown key", "expected one of name, title, "),
    (
        ["bench", "scene.toml", "--out", "a", "--tolerance", "3"],
        "--tolerance",
        "expected: polhode bench [OPTIONS]",
    ),
    (["throughput", "--out", "/proc"], "/proc/README.md", "expected an existing one"),
    (["accuracy", "--out", "/proc"], "/proc/README.md", "expected an existing one"),
    (["paper", "--out", "/proc"], "/proc/README.md", "expected an existing one"),
    (["paper", "perid"], "got 'perid' (did you mean 'period'?)", "expected one of period-change,"),
    (["bench", "--solver", "taylr"], "'taylr' (did you mean 'taylor'?)", "expected one of bdf,"),
    (["bench", "--scene", "papr"], "'papr' (did you mean 'paper'?)", "expected one of paper,"),
    (["sweep", "sweep.toml", "--workers", "-2"], "-2 is not", "in the range x>=0"),
    (["compare", "a.json", "b.json", "--slower", "x"], "'x'", "is not a valid float"),
    (["export"], "Missing argument 'STORE'", "expected: polhode export [OPTIONS] STORE OUT"),
    (["export", "no-such-store", "a.csv"], "no-such-store", "expected a file of `polhode bench`"),
    (
        ["export", "scene.toml", "a.csv"],
        "scene.toml: not a readable store",
        "file is not a database",
    ),
]


@pytest.mark.usefixtures("scene_file")
@pytest.mark.parametrize(
    ("arguments", "got", "expected"),
    BAD_ARGUMENTS,
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_arguments_get_one_line(
    here: Run, tmp_path: Path, arguments: list[str], got: str, expected: str
):
    line = refusal(here(*arguments), tmp_path)
    assert got in line
    assert expected in line


BAD_FILES = [
    ("", "stokes: missing", "expected a value"),
    ("stokes = [", "expected a TOML file", "Invalid value"),
    (
        SCENE.replace("1000.0", "-3.0"),
        "stokes: got -3.0",
        "expected a number greater than or equal to 0",
    ),
    (SCENE.replace("0.8", "nan"), "shape.semi_axes[1]: got nan", "expected a finite number"),
    (
        SCENE.replace("= [1.0, 1.0, -1.0]", "= [1e160, 1.0, 0.0]"),
        "got [1e+160, 1.0, 0.0]",
        "of at most 1e+30",
    ),
    (
        SCENE.replace("slow_time = 0.5", "time = 5e-324"),
        "time: got 5e-324",
        "expected a finite number from 1e-60",
    ),
    ("x = " + "[" * 20_000, "expected a TOML file", "nested too deeply"),
    (
        SCENE + '"\\u001b[31mred" = 3',
        "start.\\x1b[31mred: unknown key",
        "expected one of euler_angles,",
    ),
    (
        SCENE.replace("euler_rates", "euler_rate"),
        "start.euler_rate: unknown key",
        "expected one of euler_angles,",
    ),
]


@pytest.mark.parametrize(
    ("text", "got", "expected"),
    BAD_FILES,
    ids=["empty", "bad TOML", "range", "NaN", "fast", "short", "nested", "escapes", "key"],
)
def test_a_bad_scene_file_gets_one_line(
    here: Run, scene_file: Path, tmp_path: Path, text: str, got: str, expected: str
):
    scene_file.write_text(text, encoding="utf-8")
    line = refusal(here("solve", "scene.toml", "--out", "a.csv"), tmp_path)
    assert line.startswith("polhode: scene.toml: ")
    assert got in line
    assert expected in line


def test_a_scene_that_is_no_text_gets_one_line(here: Run, scene_file: Path, tmp_path: Path):
    scene_file.write_bytes(b"\xff\xfe\x00")
    assert "expected a TOML file" in refusal(
        here("solve", "scene.toml", "--out", "a.csv"), tmp_path
    )


@pytest.mark.parametrize(
    ("target", "line"),
    [
        ("/dev/zero", "expected a TOML file: got more than"),
        ("scene.toml", "got 'scene.toml', expected a file or one of"),
    ],
)
def test_a_scene_without_end_gets_one_line(here: Run, tmp_path: Path, target: str, line: str):
    (tmp_path / "scene.toml").symlink_to(target)
    assert line in refusal(here("solve", "scene.toml", "--out", "a.csv"), tmp_path)


def test_a_scene_that_begins_with_a_byte_order_mark_is_a_scene(here: Run, tmp_path: Path):
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8-sig")
    assert json.loads(here("scenes", "scene.toml", "--json").stdout)["stokes"] == 1000


@pytest.mark.parametrize(
    ("start", "question"),
    [
        (
            "euler_angles = [60.0, 30.0, 0.0]",
            "start.euler_angles: got [60.0, 30.0, 0.0] rad, beyond 2π; were degrees",
        ),
        (
            "quaternion = [1.0, 1.0, 0.0, 0.0]",
            "start.quaternion: got [1.0, 1.0, 0.0, 0.0] of norm 1.41",
        ),
    ],
)
def test_what_is_legal_and_surely_not_meant_is_questioned(
    here: Run, scene_file: Path, start: str, question: str
):
    scene_file.write_text(
        SCENE.partition("euler_angles")[0] + f"{start}\nat_rest = true\n", encoding="utf-8"
    )
    done = here("scenes", "scene.toml")
    assert done.returncode == 0
    assert done.stderr.startswith(f"note: {question}")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "arguments", [("forms",), ("solve", "paper", *GIVEN, "--samples", "9", "--out", "-")]
)
def test_a_full_standard_output_is_said_in_a_line_and_a_closed_one_is_none(
    environment, arguments: tuple[str, ...]
):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [SCRIPT, *arguments], stdout=full, stderr=subprocess.PIPE, env=environment, check=False
        )
    assert done.returncode == 1
    assert done.stderr.decode().splitlines()[-1].startswith("polhode: ")
    assert b"Traceback" not in done.stderr
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [SCRIPT, *arguments], stdout=writing, stderr=subprocess.PIPE, env=environment, check=False
    )
    os.close(writing)
    assert b"polhode:" not in done.stderr
    assert b"Traceback" not in done.stderr


def test_a_refusal_leaves_an_earlier_result_alone(here: Run, scene_file: Path, tmp_path: Path):
    (tmp_path / "a.csv").write_text("earlier", encoding="utf-8")
    assert here("solve", "scene.toml", "--out", "a.csv", "--solver", "rk4").returncode == 2
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "earlier"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", scene_file.name]
