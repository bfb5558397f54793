"""The wheel in fresh environments, with no extra and with each one alone."""

import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from versions.tools import (
    BUILD,
    SMOKE,
    Found,
    answers_of,
    bare_environment,
    full_version,
    interpreter,
    uv,
)

# Pythons that are tried if none is named: the oldest, and one with newer NumPy and SciPy.
USUAL = ("3.11", "3.13")
NONE = "none"
# Steps of `smoke.py` that an extra is for; without it they refuse in a line that names the extra.
STEPS = {
    NONE: (),
    "figures": ("plot", "draw"),
    "site": ("plot", "draw", "report"),
    "dask": ("dask",),
    "data": ("to_xarray", "to_parquet"),
}
# Steps that need no extra.
PLAIN = ("solve", "pick", "solve_ivp", "WorkPrecision")
# The extra that the line names where a step is refused. What `site` draws, it draws by `figures`.
NAMED = {"plot": "figures", "draw": "figures", "report": "site", "dask": "dask"}
NAMED |= {"to_xarray": "data", "to_parquet": "data"}
# Seconds after which the steps taken in an environment are stopped: far more than they take.
SECONDS = 600.0


def wheel() -> Path:
    """The wheel, built anew."""
    folder = BUILD / "wheel"
    uv("build", "--quiet", "--clear", "--wheel", "--out-dir", folder)
    return next(folder.glob("*.whl"))


def faults(answers: dict[str, dict], extra: str) -> Iterator[str]:
    """What is wrong with the answers of an environment that has an extra."""
    for step, answer in answers.items():
        refusal = answer.get("refused", "")
        if "fault" in answer:
            yield f"{step}: {answer['fault']}"
        elif step in PLAIN or step in STEPS[extra]:
            if refusal:
                yield f"{step} is refused: {refusal}"
        elif step in NAMED and f"polhode[{NAMED[step]}]" not in refusal:
            yield f"{step}: {refusal or 'works'}, expected a line that names polhode[{NAMED[step]}]"
    missing = {*PLAIN, *NAMED} - set(answers)
    if missing:
        yield f"steps that did not run: {', '.join(sorted(missing))}"


def one(version: str, extra: str, built: Path) -> Found:
    """What works in a fresh environment of a Python with an extra."""
    python = interpreter(version)
    if python is None:
        return {"why": "no such Python here"}
    try:
        there = bare_environment(python, BUILD / f"extra-{extra}-{version}")
        asked = str(built) if extra == NONE else f"{built}[{extra}]"
        words = ["pip", "install", "--quiet", "--python", there, "--only-binary", ":all:"]
        uv(*words, asked)
    except RuntimeError as error:
        return {"why": str(error)}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [there, "-P", SMOKE, "answers", "extras"],
            cwd=folder,
            env={"PATH": f"{there.parent}:/usr/bin:/bin", "HOME": folder, "LANG": "C.UTF-8"},
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )
    answers = answers_of(done.stdout)
    found = {
        "python": full_version(there),
        "works": ", ".join(step for step, answer in answers.items() if "numbers" in answer),
        "refused": ", ".join(step for step, answer in answers.items() if "refused" in answer),
    }
    wrong = list(faults(answers, extra)) if answers else [done.stderr[-500:]]
    return {**found, "why": "; ".join(wrong)} if wrong else found
