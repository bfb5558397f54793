"""The digest of the code: what decides results changes it, and nothing else does."""

from pathlib import Path

import pytest

from polhode.harness.common import code_digest as module
from polhode.harness.common.code_digest import code_digest, digest_of

MODULE = """\"\"\"A module.\"\"\"

LIMIT = 3  # runs


def total(first: int, second: int) -> str:
    \"\"\"The sum.\"\"\"
    return f"{first + second} of {LIMIT}"
"""
FORMATTED = """# Said otherwise.

LIMIT = 3


def total(
    first: int,
    second: int,
) -> str:
    \"\"\"The sum of both,

    in words.
    \"\"\"
    return (
        f'{first + second} of {LIMIT}'
    )
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    texts_by_name = {
        "models/a.py": MODULE,
        "models/files/our_words.toml": 'a = "b"\n',
        "solvers/b.toml": "limit = 3\n",
        "solvers/c.ll": "ret void\n",
        "harness/fitted.json": '{"factor": 2.0}\n',
        "harness/pages/d.py": MODULE,
        "harness/site/e.toml": "limit = 3\n",
        "harness/advice.md": "Words.\n",
    }
    for name, text in texts_by_name.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return tmp_path


def changes(root: Path, name: str, text: str) -> bool:
    before = digest_of(root)
    (root / name).write_text(text, encoding="utf-8")
    return digest_of(root) != before


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("models/a.py", MODULE.replace("LIMIT = 3", "LIMIT = 4")),
        ("models/a.py", MODULE.replace(" of ", " from ")),
        ("models/new.py", "LIMIT = 3\n"),
        ("solvers/b.toml", "limit = 4\n"),
        ("solvers/c.ll", "unreachable\n"),
        ("harness/fitted.json", '{"factor": 3.0}\n'),
    ],
)
def test_what_decides_results_changes_the_digest(root: Path, name: str, text: str):
    assert changes(root, name, text)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("models/a.py", FORMATTED),
        ("solvers/b.toml", "# Runs.\nlimit   = 3\n"),
        ("models/files/our_words.toml", 'a = "c"\n'),
        ("harness/pages/d.py", "LIMIT = 4\n"),
        ("harness/site/e.toml", "limit = 4\n"),
        ("harness/advice.md", "Other words.\n"),
    ],
)
def test_words_formatting_and_styles_do_not(root: Path, name: str, text: str):
    assert not changes(root, name, text)


def test_all_versions_of_python_give_the_same(root: Path):
    """The number was computed under 3.11, 3.12 and 3.13."""
    assert digest_of(root) == "5b30082591b2"


def test_the_digest_of_today_is_of_twelve_hexadecimal_digits():
    assert len(code_digest()) == 12
    assert int(code_digest(), 16) >= 0


def test_the_digest_comes_from_the_disk_the_second_time(tmp_path, monkeypatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    code_digest.cache_clear()
    first = code_digest()
    code_digest.cache_clear()
    monkeypatch.setattr(module, "digest_of", lambda root: "parsed again")
    assert code_digest() == first == digest_of(module._ROOT)
    code_digest.cache_clear()
