"""What Tab offers."""

import os
import subprocess
from pathlib import Path

import pytest
from commandline import SCRIPT, Run

from polhode.models.scenes import SCENES
from polhode.solvers.catalogue import SOLVERS


def offered(words: str, count: int) -> list[str]:
    environment = {
        **os.environ,
        "COMP_WORDS": words,
        "COMP_CWORD": str(count),
        "_POLHODE_COMPLETE": "bash_complete",
    }
    done = subprocess.run(
        [SCRIPT], env=environment, capture_output=True, text=True, timeout=60, check=True
    )
    return [line.partition(",")[2] for line in done.stdout.splitlines()]


@pytest.mark.parametrize(
    ("words", "count", "expected"),
    [
        ("polhode doc", 1, ["doctor"]),
        ("polhode pick pinch", 2, ["pinch-point"]),
        (
            "polhode solve paper --solver cvode",
            4,
            [name for name in SOLVERS if name.startswith("cvode")],
        ),
        ("polhode solve paper --form spheroid", 4, ["spheroid-angles", "spheroid-axis"]),
        ("polhode report --scene ", 3, list(SCENES)),
        ("polhode solve own.to", 2, ["own.to"]),
    ],
)
def test_completion(words: str, count: int, expected: list[str]):
    assert offered(words, count) == expected


def test_the_script_completes_in_a_shell(polhode: Run):
    script = polhode("completion", "bash").stdout
    typed = (
        "COMP_WORDS=(polhode doc); COMP_CWORD=1; _polhode_completion polhode; echo ${COMPREPLY[@]}"
    )
    path = f"{Path(SCRIPT).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", f"{script}\n{typed}"],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert done.stdout.split() == ["doctor"]
