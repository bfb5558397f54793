"""Code and data files on which an experiment's `compute` depends, found by following its imports.

`store.py` keeps `code_key` with the data of an item: the data are today's if the key is still the
same. A key changes with any of these:

- In `harness/paper`, a definition (function, class or constant) that `compute` reaches. Words,
  ranges and figures stand beside the computation and may change.
- Elsewhere, a whole module that is reached, and a data file beside it that it reads. A module of
  `harness/paper` counts as a whole too where it is imported as a module.
- The module of a form or a solver whose name stands as a string in what is reached: "taylor" brings
  `polhode.solvers.taylor`.

Comments, docstrings and line breaks never count; a string below a constant does. Names are
followed, not calls: what is reached may be more than what runs. It is less only where code finds
other code by neither import nor name.
"""

import ast
import importlib.util
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from polhode.harness.common.files import digest
from polhode.harness.paper.item import Experiment
from polhode.models.catalogue import FORMS
from polhode.solvers.catalogue import SOLVERS

_PACKAGE = "polhode"
_PAPER = "polhode.harness.paper"
# Modules that name all forms and all solvers: only the entries that are named count.
_CATALOGUES = ("polhode.models.catalogue", "polhode.solvers.catalogue")
# Endings of data files that code reads; `.ll` is machine code as LLVM's text.
_DATA_SUFFIXES = (".toml", ".ll", ".json")
# The method of an experiment that makes its data.
_COMPUTATION = "compute"
# Methods that only use the data. A class that has one of them is an experiment.
_PRESENTATION = ("judge", "draw", "expected")
# The class variable that only says in which order items are begun.
_DURATION = "seconds"


@dataclass
class _Reached:
    """The code that has been reached so far."""

    # Syntax trees of definitions in `harness/paper`, without docstrings, by module and name.
    definitions: dict[tuple[str, str], ast.AST] = field(default_factory=dict)
    # Modules that count as a whole.
    modules: set[str] = field(default_factory=set)
    # Strings in the definitions and modules: some are names of forms and solvers.
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
    # The module of an entry may name further entries: repeat this until it adds no module.
    count_before = -1
    while len(reached.modules) != count_before:
        count_before = len(reached.modules)
        _reach_named_entries(reached)
    return reached


def _reach_named_entries(reached: _Reached) -> None:
    """Add the modules of the forms and solvers whose names are among the strings."""
    for catalogue in (FORMS, SOLVERS):
        for entry, target in catalogue.items():
            if entry in reached.strings:
                # A target is "module:object".
                _reach_module(target.partition(":")[0], reached)


def files_of(reached: _Reached) -> list[Path]:
    """Files of the modules that are reached, and the data files that belong to them.

    A data file belongs to a module of the same folder that names it, or has its name but for the
    ending.
    """
    files = set()
    for module in reached.modules:
        source = source_of(module)
        if source is None:
            continue
        files.add(source)
        strings = _strings(_tree(module))
        for path in source.parent.iterdir():
            belongs = path.name in strings or path.stem == source.stem
            if path.suffix in _DATA_SUFFIXES and belongs:
                files.add(path)
    return sorted(files)


def _reach_definition(module: str, name: str, reached: _Reached) -> None:
    """Add what a name means in a module, and all that this uses.

    The name may be defined there or imported from this package; others, such as local variables,
    add nothing.
    """
    if (module, name) in reached.definitions:
        return
    node = _definitions(module).get(name)
    if node is None:
        target = _imports(module).get(name)
        if target:
            _reach_import(*target, reached)
        return
    node = _computing(node)
    reached.definitions[module, name] = node
    reached.strings |= _strings(node)
    for inner in ast.walk(node):
        if isinstance(inner, ast.Name):
            _reach_definition(module, inner.id, reached)


def _computing(node: ast.AST) -> ast.AST:
    """A copy of a definition without docstrings; of an experiment only what its `compute` uses."""
    # Parsed anew, since the tree is changed.
    tree = ast.parse(ast.unparse(node))
    for inner in ast.walk(tree):
        if isinstance(inner, ast.ClassDef | ast.FunctionDef):
            if ast.get_docstring(inner) is not None:
                inner.body = inner.body[1:] or [ast.Pass()]
            if isinstance(inner, ast.ClassDef):
                inner.body = _used_by_compute(inner.body)
    return tree


def _used_by_compute(body: list[ast.stmt]) -> list[ast.stmt]:
    """Statements of an experiment's body that `compute` uses; the whole body of another class.

    These are `compute`, the methods that it calls, and the fields of the experiment's settings.
    """
    methods = {part.name: part for part in body if isinstance(part, ast.FunctionDef)}
    if not set(_PRESENTATION) & set(methods):
        return body
    used = _called_from(_COMPUTATION, methods)
    computing = []
    for part in body:
        is_method = isinstance(part, ast.FunctionDef)
        if is_method and part.name in used:
            computing.append(part)
        if not is_method and not _only_presents(part):
            computing.append(part)
    return computing or [ast.Pass()]


def _called_from(first: str, methods: Mapping[str, ast.FunctionDef]) -> set[str]:
    """Names of a method and of all those that it calls, directly or by others.

    A method counts as called where an attribute has its name.
    """
    called: set[str] = set()
    waiting = [first]
    while waiting:
        name = waiting.pop()
        if name in methods and name not in called:
            called.add(name)
            inside = ast.walk(methods[name])
            waiting += [node.attr for node in inside if isinstance(node, ast.Attribute)]
    return called


def _only_presents(part: ast.stmt) -> bool:
    """Whether a statement of an experiment's body is a field that `compute` does not use.

    That is the item's duration, or a field with ``repr=False``, by which experiments mark what only
    judges or draws: the key of the data has the `repr` of the settings, and so leaves it out too.
    """
    if not isinstance(part, ast.AnnAssign):
        return False
    if ast.unparse(part.target) == _DURATION:
        return True
    if not isinstance(part.value, ast.Call):
        return False
    arguments = {word.arg: ast.unparse(word.value) for word in part.value.keywords}
    return arguments.get("repr") == "False"


def _reach_import(module: str, name: str, reached: _Reached) -> None:
    """Add what ``from module import name`` brings: a module, or a definition of one."""
    submodule = f"{module}.{name}"
    if source_of(submodule):
        _reach_module(submodule, reached)
    elif module.startswith(_PAPER):
        _reach_definition(module, name, reached)
    else:
        _reach_module(module, reached)


def _reach_module(module: str, reached: _Reached) -> None:
    """Add a whole module and those that it imports; a catalogue without its entries."""
    if module in reached.modules or not source_of(module):
        return
    reached.modules.add(module)
    tree = _tree(module)
    if module not in _CATALOGUES:
        reached.strings |= _strings(tree)
    else:
        # The table itself has the names of all entries: only strings in functions name some.
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                reached.strings |= _strings(node)
    for imported_module, name in _imports(module).values():
        _reach_import(imported_module, name, reached)


@cache
def _tree(module: str) -> ast.Module:
    """The syntax tree of a module's file."""
    # Experiments of tests stand outside the package, in modules that are loaded.
    path = source_of(module) or Path(str(sys.modules[module].__file__))
    return ast.parse(path.read_bytes())


@cache
def _definitions(module: str) -> dict[str, ast.AST]:
    """Functions, classes and assigned names of a module, with the statements that define them."""
    definitions: dict[str, ast.AST] = {}
    for node in _tree(module).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            definitions[node.name] = node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for name in _assigned(node):
                definitions[name] = node
    return definitions


def _assigned(node: ast.Assign | ast.AnnAssign) -> list[str]:
    """Names in the targets of an assignment."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    names = []
    for target in targets:
        names += [inner.id for inner in ast.walk(target) if isinstance(inner, ast.Name)]
    return names


@cache
def _imports(module: str) -> dict[str, tuple[str, str]]:
    """Names that a module imports from the package, each with the module and the name there."""
    imports: dict[str, tuple[str, str]] = {}
    for node in ast.walk(_tree(module)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == _PACKAGE:
            for alias in node.names:
                imports[alias.asname or alias.name] = (str(node.module), alias.name)
    return imports


@cache
def _strings(node: ast.AST) -> frozenset[str]:
    """All strings in a tree."""
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
    """A text that changes if and only if what a file means does.

    Python and TOML count as they are read, without comments and line breaks; Python without
    docstrings too. Other files count as they are.
    """
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".toml":
        return repr(tomllib.loads(text))
    if path.suffix != ".py":
        return text
    tree = ast.parse(text)
    for node in ast.walk(tree):
        may_have_docstring = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if may_have_docstring and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.dump(tree)
