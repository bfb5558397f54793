"""The page on misprints and the tests behind it name the same tests."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_page_and_tests_agree():
    files = set(Path(__file__).parent.glob("test_*.py")) - {Path(__file__)}
    functions = {
        node.name
        for file in files
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }
    page = (ROOT / "docs" / "misprints.md").read_text(encoding="utf-8")
    assert set(re.findall(r"`(test_(?:right|misprint)_\w+)`", page)) == functions
