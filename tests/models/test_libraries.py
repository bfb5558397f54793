"""Libraries are imported under one lock where threads may ask for them at once."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# Libraries that others import too, or whose parts import each other.
LIBRARIES = {"scipy", "CyRK", "heyoka", "sksundae"}


def imported(node: ast.AST) -> str:
    """The library that a statement imports; "" if it is no import."""
    if isinstance(node, ast.Import):
        return node.names[0].name.partition(".")[0]
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").partition(".")[0]
    return ""


def unguarded(tree: ast.AST) -> list[int]:
    """Lines that import one of LIBRARIES in a function, outside `with IMPORTS`."""
    lines = []
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        guarded = set()
        for block in ast.walk(function):
            if isinstance(block, ast.With) and ast.unparse(block.items[0]) == "IMPORTS":
                guarded |= {id(node) for node in ast.walk(block)}
        lines += [
            node.lineno
            for node in ast.walk(function)
            if imported(node) in LIBRARIES and id(node) not in guarded
        ]
    return lines


@pytest.mark.parametrize("folder", ["models", "solvers", "harness/answers", "harness/references"])
def test_imports_in_functions_hold_the_lock(folder: str):
    found = {
        str(path.relative_to(ROOT)): unguarded(ast.parse(path.read_text(encoding="utf-8")))
        for path in (ROOT / folder).rglob("*.py")
    }
    assert {path: lines for path, lines in found.items() if lines} == {}


def test_an_import_without_the_lock_is_found():
    source = "def f():\n    with IMPORTS:\n        import scipy\n    from scipy import special\n"
    assert unguarded(ast.parse(source)) == [4]
