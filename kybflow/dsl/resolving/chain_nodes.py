"""Chains in the tree: which behavior is one, what it is called elsewhere, where it is used."""

from __future__ import annotations

from dataclasses import replace

from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence
from kybflow.dsl.reading.source import Span


def chain_of(node: Node) -> Scalar | None:
    """The `do` of a behavior that is a chain; None for any other."""
    do = node.get("do") if isinstance(node, Mapping) else None
    return do if isinstance(do, Scalar) and do.text.startswith("chain.") else None


def qualified(vehicle: Mapping, library: str) -> Mapping:
    """A vehicle of `library` as the importing file sees it: its chains have the import's name."""
    behaviors = vehicle.entries.get("behaviors")
    if behaviors is None or not isinstance(behaviors.value, Mapping):
        return vehicle
    entries = dict(behaviors.value.entries)
    for name, entry in entries.items():
        do = chain_of(entry.value)
        if do is not None and isinstance(entry.value, Mapping):
            text = f"chain.{library}.{do.text.removeprefix('chain.')}"
            named = entry.value.entries["do"]._replace(value=do._replace(text=text))
            body = Mapping({**entry.value.entries, "do": named}, entry.value.span)
            entries[name] = entry._replace(value=body)
    whole = behaviors._replace(value=Mapping(entries, behaviors.value.span))
    return Mapping({**vehicle.entries, "behaviors": whole}, vehicle.span)


def used_at(node: Node, places: tuple[Span, ...]) -> Node:
    """A copy of what stands in a chain that remembers where the chain is used."""
    span = replace(node.span, used=places)
    if isinstance(node, Scalar):
        return node._replace(span=span)
    if isinstance(node, Sequence):
        return Sequence(tuple(used_at(item, places) for item in node.items), span)
    entries = {
        key: entry._replace(key=_key(entry.key, places), value=used_at(entry.value, places))
        for key, entry in node.entries.items()
    }
    return Mapping(entries, span)


def _key(key: Scalar, places: tuple[Span, ...]) -> Scalar:
    return key._replace(span=replace(key.span, used=places))
