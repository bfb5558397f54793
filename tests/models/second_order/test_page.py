"""`docs/second-order.md` names what the code names: each name and file stands there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
MODULES = [*ROOT.glob("models/second_order/*.py"), *ROOT.glob("models/hybrid/*.py")]
SOURCE = "\n".join(
    path.read_text(encoding="utf-8")
    for path in (*MODULES, *ROOT.glob("solvers/[cm]*t*.*"), ROOT / "harness" / "solution.py")
)
WORDS = re.findall(r"`([^`\n]+)`", (ROOT / "docs" / "second-order.md").read_text(encoding="utf-8"))
# Forms, a command, and what a user types.
OTHERS = {"quaternion", "spheroid-axis", "polhode solve", "hypot(smaller, fading)"}


@pytest.mark.parametrize("words", sorted(set(WORDS) - OTHERS))
def test_names_are_those_of_the_code(words: str):
    if words.endswith((".py", ".toml", "/")):
        path = words.split()[-1]
        rooms = (ROOT, ROOT / "models", ROOT / "models" / "second_order")
        assert any((room / path).exists() for room in rooms), words
        return
    if not re.match(r"[A-Za-z_.]+(\(|$)", words):
        return
    for name in re.split(r"[.]", words.split("(")[0]):
        assert re.search(rf"\b{re.escape(name)}\b", SOURCE), name
