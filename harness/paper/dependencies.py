"""Code and data of an experiment: the definitions and modules that its `compute` reaches by import.

Cached data are today's if none of these has changed. Inside `harness/paper` single
definitions count, so that words, ranges and figures may change beside the computation. Elsewhere
whole modules count. A catalogue's entry counts where its name stands as a string in what is
reached: "taylor" brings `polhode.solvers.taylor`.
"""

import ast
import importlib.util
import sys
import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from polhode.harness.common.files import digest
from polhode.harness.paper.item import Experiment
from polhode.models.catalogue import FORMS
from polhode.solvers.catalogue import SOLVERS

_PACKAGE = "polhode"
_PAPER = "polhode.harness.paper"
# Their entries count one by one, by name.
_CATALOGUES = ("polhode.models.catalogue", "polhode.solvers.catalogue")
# Data that code reads: they count with the module whose name they carry, or that names them.
_DATA_SUFFIXES = (".toml", ".ll", ".json")
# The method of an experiment that makes its data, and the methods that use them.
_COMPUTATION = "compute"
_PRESENTATION = ("judge", "draw", "expected")
# The class variable that says when to begin an item, and changes no number of it.
_DURATION = "seconds"


@dataclass
class _Reached:
    """Definitions and modules found so far, and the strings in them."""

    definitions: dict[tuple[str, str], ast.AST] = field(default_factory=dict)
    modules: set[str] = field(default_factory=set)
    strings: set[str] = field(default_factory=set)


def code_key(experiment: Experiment) -> str:
    """Hash of all code and data files that an experiment's `compute` reaches."""
    kind = type(experiment)
    return _key_of(kind.__module__, kind.__qualname__)


@cache
def _key_of(module: str, name: str) -> str:
    """Hash of what a class of a module reaches: the same for all experiments of the class."""
    reached = reached_from(module, name)
    definitions = [
        f"{place}.{definition}: {ast.dump(node)}"
        for (place, definition), node in reached.definitions.items()
    ]
    files = [meaning(path) for path in files_of(reached)]
    return digest([sorted(definitions), files])


def reached_from(module: str, name: str) -> _Reached:
    """All that a definition of a module reaches, with the catalogue entries that it names."""
    reached = _Reached()
    _reach_definition(module, name, reached)
    # An entry's module may name further entries, so that this goes on until no module is added.
    before = -1
    while before != len(reached.modules):
        before = len(reached.modules)
        for catalogue in (FORMS, SOLVERS):
            for entry, target in catalogue.items():
                if entry in reached.strings:
                    _reach_module(target.partition(":")[0], reached)
    return reached


def files_of(reached: _Reached) -> list[Path]:
    """Files of the modules that are reached, and the data files beside them that belong to them."""
    files = set()
    for module in reached.modules:
        path = source_of(module)
        if path is None:
            continue
        files.add(path)
        strings = _strings(_tree(module))
        for beside in path.parent.iterdir():
            named = beside.name in strings or beside.stem == path.stem
            if beside.suffix in _DATA_SUFFIXES and named:
                files.add(beside)
    return sorted(files)


def _reach_definition(module: str, name: str, reached: _Reached) -> None:
    """Add a definition of a module of this package, and all that it uses."""
    if (module, name) in reached.definitions:
        return
    node = _definitions(module).get(name)
    if node is None:
        target = _imports(module).get(name)
        if target:
            _reach(*target, reached)
        return
    node = _computing(node)
    reached.definitions[module, name] = node
    reached.strings |= _strings(node)
    for inner in ast.walk(node):
        if isinstance(inner, ast.Name):
            _reach_definition(module, inner.id, reached)


def _computing(node: ast.AST) -> ast.AST:
    """A definition without docstrings; of an experiment only what its `compute` uses."""
    # Parsed anew: the node that is kept is changed.
    tree = ast.parse(ast.unparse(node))
    for inner in ast.walk(tree):
        if isinstance(inner, ast.ClassDef | ast.FunctionDef):
            if ast.get_docstring(inner) is not None:
                inner.body = inner.body[1:] or [ast.Pass()]
            if isinstance(inner, ast.ClassDef):
                inner.body = _used_by_compute(inner.body)
    return tree


def _used_by_compute(body: list[ast.stmt]) -> list[ast.stmt]:
    """Statements of an experiment's body: fields of its settings, `compute`, and the methods that it calls."""
    methods = {part.name: part for part in body if isinstance(part, ast.FunctionDef)}
    if not set(_PRESENTATION) & set(methods):
        return body
    used: set[str] = set()
    waiting = [_COMPUTATION]
    while waiting:
        name = waiting.pop()
        if name in methods and name not in used:
            used.add(name)
            waiting += [
                part.attr for part in ast.walk(methods[name]) if isinstance(part, ast.Attribute)
            ]
    kept = []
    for part in body:
        method = isinstance(part, ast.FunctionDef)
        if part.name in used if method else not _left_out_of_settings(part):
            kept.append(part)
    return kept or [ast.Pass()]


def _left_out_of_settings(part: ast.stmt) -> bool:
    """Whether a statement is a field with ``repr=False``, which only judges or draws, or the item's duration."""
    if isinstance(part, ast.AnnAssign) and ast.unparse(part.target) == _DURATION:
        return True
    value = part.value if isinstance(part, ast.AnnAssign) else None
    if not isinstance(value, ast.Call):
        return False
    return any(word.arg == "repr" and ast.unparse(word.value) == "False" for word in value.keywords)


def _reach(module: str, name: str, reached: _Reached) -> None:
    """Add what an import statement brings."""
    submodule = f"{module}.{name}"
    if source_of(submodule):
        _reach_module(submodule, reached)
    elif module.startswith(_PAPER):
        _reach_definition(module, name, reached)
    else:
        _reach_module(module, reached)


def _reach_module(module: str, reached: _Reached) -> None:
    """Add a module and those that it imports; a catalogue without its entries."""
    if module in reached.modules or not source_of(module):
        return
    reached.modules.add(module)
    tree = _tree(module)
    if module not in _CATALOGUES:
        reached.strings |= _strings(tree)
    else:
        # Strings of functions name entries; strings of the table are the table.
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                reached.strings |= _strings(node)
    for place, name in _imports(module).values():
        _reach(place, name, reached)


@cache
def _tree(module: str) -> ast.Module:
    """The syntax tree of a module's file."""
    # Experiments of tests stand outside the package.
    path = source_of(module) or Path(str(sys.modules[module].__file__))
    return ast.parse(path.read_bytes())


@cache
def _definitions(module: str) -> dict[str, ast.AST]:
    """Functions, classes and assigned names of a module."""
    definitions: dict[str, ast.AST] = {}
    for node in _tree(module).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            definitions[node.name] = node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                for inner in ast.walk(target):
                    if isinstance(inner, ast.Name):
                        definitions[inner.id] = node
    return definitions


@cache
def _imports(module: str) -> dict[str, tuple[str, str]]:
    """Names that a module imports from the package: name to (module, name there)."""
    imports: dict[str, tuple[str, str]] = {}
    for node in ast.walk(_tree(module)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == _PACKAGE:
            for alias in node.names:
                imports[alias.asname or alias.name] = (str(node.module), alias.name)
    return imports


@cache
def _strings(node: ast.AST) -> frozenset[str]:
    """Strings of a tree, docstrings and words of several lines among them."""
    return frozenset(
        inner.value
        for inner in ast.walk(node)
        if isinstance(inner, ast.Constant) and isinstance(inner.value, str)
    )


@cache
def source_of(module: str) -> Path | None:
    """The file of a module of the package; None if there is none of that name."""
    if module.split(".")[0] != _PACKAGE:
        return None
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        return None
    return Path(spec.origin) if spec and spec.origin else None


@cache
def meaning(path: Path) -> str:
    """A file without comments, docstrings and the way it is broken into lines."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".toml":
        return repr(tomllib.loads(text))
    if path.suffix != ".py":
        return text
    tree = ast.parse(text)
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if documented and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.dump(tree)
