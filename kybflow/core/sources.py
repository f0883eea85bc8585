"""Read what mypyc drops from the source of a compiled module: the module's docstring, and the
annotations of its classes with their units. The source file is in the same folder."""

from __future__ import annotations

import ast
import functools
import sys
from pathlib import Path
from typing import Any, get_type_hints

_COMPILED = (".so", ".pyd")


def docstring_of(module: str) -> str:
    """Return the docstring of an imported module, compiled or not; empty if it has none."""
    return sys.modules[module].__doc__ or ast.get_docstring(_source(module), clean=False) or ""


def help_of(cls: type) -> str:
    """Return the docstring of a class in one line, compiled or not."""
    nodes = (node for node in _source(cls.__module__).body if isinstance(node, ast.ClassDef))
    written = [ast.get_docstring(node) for node in nodes if node.name == cls.__name__]
    return " ".join(((written[0] if written else cls.__doc__) or "").split())


def is_compiled(cls: type) -> bool:
    """Return whether a class's module is compiled."""
    return _file(cls.__module__).suffix in _COMPILED


def hints_of(cls: type) -> dict[str, Any]:
    """Return the annotations of a class and its bases as types, including their units."""
    for base in cls.__mro__:
        for node in _source(base.__module__).body:
            if isinstance(node, ast.ClassDef) and node.name == base.__name__:
                lines = [line for line in node.body if isinstance(line, ast.AnnAssign)]
                written = {ast.unparse(x.target): ast.unparse(x.annotation) for x in lines}
                base.__annotations__ = written
    return get_type_hints(cls, include_extras=True)


def _file(module: str) -> Path:
    return Path(getattr(sys.modules.get(module), "__file__", None) or ".")


def _source(module: str) -> ast.Module:
    """Return the syntax tree of a compiled module's source; an empty one if the module isn't
    compiled."""
    file = _file(module)
    return _parsed(file) if file.suffix in _COMPILED else ast.Module([], [])


@functools.cache
def _parsed(compiled: Path) -> ast.Module:
    source = compiled.with_name(f"{compiled.name.partition('.')[0]}.py")
    return ast.parse(source.read_text(encoding="utf-8") if source.exists() else "")
