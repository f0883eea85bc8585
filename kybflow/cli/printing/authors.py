"""The page for authors of parts: what `kybflow.parts` offers, by its docstrings and signatures."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import kybflow.parts

_HEAD = """\
# Parts in Python

What `from kybflow.parts import ...` offers to authors of [their own parts](your-own-parts.md).

This page is generated: `kybflow parts --api --write docs/parts-in-python.md`.
"""


def page() -> str:
    """Return the page as Markdown."""
    offered = {name: getattr(kybflow.parts, name) for name in kybflow.parts.__all__}
    classes = [one for one in offered.values() if inspect.isclass(one)]
    functions = [one for one in offered.values() if inspect.isfunction(one)]
    blocks = [_HEAD, inspect.getdoc(kybflow.parts) or ""]
    for one in sorted(classes, key=_rank):
        blocks += _class(one)
    blocks += ["## Functions", *(block for one in functions for block in _function(one, "###"))]
    others = [f"`{name}`" for name, one in offered.items() if one not in (*classes, *functions)]
    blocks.append(f"Constants and types: {', '.join(others)}.")
    return "\n\n".join(block.strip() for block in blocks if block.strip()) + "\n"


def _rank(cls: type[Any]) -> tuple[bool, str]:
    """Sort the classes of parts before the values that they exchange."""
    return not issubclass(cls, kybflow.parts.Part), cls.__name__


def _class(cls: type[Any]) -> Iterator[str]:
    yield f"## `{cls.__name__}`"
    yield inspect.getdoc(cls) or ""
    if hasattr(cls, "_fields"):
        yield f"Fields: {', '.join(f'`{name}: {kind}`' for name, kind in _annotations(cls))}."
    for name, member in vars(cls).items():
        if isinstance(member, property) and inspect.getdoc(member):
            yield f"### `{name}`"
            yield inspect.getdoc(member) or ""
        own = member.__func__ if isinstance(member, classmethod) else member
        if inspect.isfunction(own) and not name.startswith("_") and inspect.getdoc(own):
            yield from _function(own, "###", "classmethod " if own is not member else "")


def _annotations(cls: type[Any]) -> list[tuple[str, str]]:
    found = inspect.get_annotations(cls).items()
    return [(name, getattr(kind, "__forward_arg__", str(kind))) for name, kind in found]


def _function(function: Any, heading: str, kind: str = "") -> Iterator[str]:
    signature = str(inspect.signature(function)).replace("'", "")
    yield f"{heading} `{kind}{function.__name__}{signature}`"
    yield inspect.getdoc(function) or ""
