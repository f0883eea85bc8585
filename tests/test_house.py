"""The shape of the package: no import circles, folders that can be read, one name for one thing.

Imports for types count like any other. `lint-imports` holds the layers.
"""

from __future__ import annotations

import ast
import functools
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from toolchain import ROOT

KYBFLOW = ROOT / "kybflow"
MOST = 16
MAY_HAVE_MORE = {
    "cli/commands", "dsl/checks",
    *(f"runtime/{kind}" for kind in ("behaviors", "faults", "supervisors")),
}  # fmt: skip
"""Folders of parts, of checks and of commands."""
TWO_THINGS: dict[str, str] = {}
"""Public class names that stand in two files, each with the reason why they may."""


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(KYBFLOW.parent).with_suffix("").parts).removesuffix(
        ".__init__"
    )


@functools.cache
def trees() -> Mapping[str, ast.Module]:
    return {name_of(p): ast.parse(p.read_text(encoding="utf-8")) for p in KYBFLOW.rglob("*.py")}


def imported(tree: ast.Module) -> Iterator[str]:
    """The modules of kybflow that a module imports, at its top, for types or inside a function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                yield inside if inside in trees() else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def graph() -> Mapping[str, set[str]]:
    """What each module imports; `kybflow` itself only offers names, and loads them when used."""
    found = {name: set(imported(tree)) & trees().keys() for name, tree in trees().items()}
    found["kybflow"] = set()
    return {name: others - {name} for name, others in found.items()}


def test_no_module_imports_itself_by_way_of_others() -> None:
    try:
        list(TopologicalSorter(graph()).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_a_folder_has_few_enough_modules_to_be_read() -> None:
    counts = Counter(str(path.parent.relative_to(KYBFLOW)) for path in KYBFLOW.rglob("*.py"))
    wide = {folder: n for folder, n in counts.items() if n > MOST and folder not in MAY_HAVE_MORE}
    assert wide == {}


def test_a_folder_says_what_is_in_it() -> None:
    folders = {name_of(path) for path in KYBFLOW.rglob("__init__.py")}
    assert "kybflow.runtime" in folders
    assert [name for name in sorted(folders) if not ast.get_docstring(trees()[name])] == []


def test_a_public_class_name_means_one_thing() -> None:
    places = defaultdict(set)
    for name, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].add(name)
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert {name: where for name, where in twice.items() if name not in TWO_THINGS} == {}
    assert len(TWO_THINGS) <= 5
    assert TWO_THINGS.keys() <= twice.keys()


def compiled() -> Iterator[Path]:
    """The modules that mypyc compiles, at least one for each pattern."""
    config = tomllib.loads((KYBFLOW.parent / "pyproject.toml").read_text(encoding="utf-8"))
    hook = config["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["mypyc"]
    for pattern in hook["include"]:
        modules = list(KYBFLOW.parent.glob(pattern))
        assert modules, pattern
        yield from modules


def test_compiled_modules_assign_no_nested_tuples() -> None:
    """mypyc boxes every number of `(a, b), (c, d) = x, y`, and none of two plain assignments."""
    nested = [
        f"{path.relative_to(KYBFLOW.parent)}:{target.lineno}"
        for path in compiled()
        for node in ast.walk(trees()[name_of(path)])
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Tuple) and any(isinstance(e, ast.Tuple) for e in target.elts)
    ]
    assert nested == []
