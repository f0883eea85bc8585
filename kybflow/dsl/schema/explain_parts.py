"""The way out where a part has no such parameter, or lacks one that it needs."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any

from kybflow.core.errors import UnitError
from kybflow.core.units import DIMENSIONS, parse_quantity
from kybflow.dsl.diagnostics.diagnostic import did_you_mean
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence

_SURE = 0.75
Schemas = dict[str, dict[str, Any]]


def meant(part: str, key: str, node: Mapping, known: Schemas, beside: frozenset[str]) -> str:
    """What `key` could mean: a parameter with a name like it, a key beside the parameters, the one
    parameter that can have its value; else every parameter."""
    if not known:
        return f"`{part}` has no parameters"
    near = get_close_matches(key, known) or get_close_matches(key, beside, cutoff=_SURE)
    if beside and not near:
        return did_you_mean(key, {*known, *beside})
    if not near:
        free = {name: schema for name, schema in known.items() if name not in node.entries}
        fitting = list(_fitting(node.entries[key].value, free))
        near = fitting if len(fitting) == 1 else []
    if near:
        return did_you_mean(near[0], {*known, *beside})
    names = ", ".join(f"`{name}`" for name in sorted(known))
    return f"the parameters of `{part}` are {names}"


def _fitting(value: Node, known: Schemas) -> Iterator[str]:
    """The parameters that can have a value: lists of the same depth, quantities with its unit."""
    for name, schema in known.items():
        dimension = DIMENSIONS.get(schema.get("x-dimension", ""))
        if isinstance(value, Sequence) and "items" in schema:
            is_path = "items" in schema["items"]
            if is_path == any(isinstance(item, Sequence) for item in value.items):
                yield name
        if isinstance(value, Scalar) and dimension is not None and "items" not in schema:
            try:
                parse_quantity(value.text, dimension)
            except UnitError:
                continue
            if not value.text.strip()[-1:].isdigit():
                yield name


def how_to_write(name: str, schema: dict[str, Any]) -> str:
    """A parameter as an author writes it, and what it is."""
    about = str(schema.get("description", "")).split(". ")[0].rstrip(".")
    example = _example(schema)
    how = f"write `{name}: {example}`" if example else f"write `{name}: ...`"
    return f"{how}: {about[:1].lower()}{about[1:]}" if about else how


def _example(schema: dict[str, Any]) -> str:
    """A value that a schema allows; empty where only its author knows one."""
    if "items" in schema and "items" in schema["items"]:
        return f"[{_example(schema['items'])}, ...]"
    dimension = DIMENSIONS.get(schema.get("x-dimension", ""))
    if dimension is None:
        return ""
    return f"[{', '.join([dimension.example] * 3)}]" if "items" in schema else dimension.example
