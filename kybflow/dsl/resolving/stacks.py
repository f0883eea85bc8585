"""`- stack: NAME` in a list of parts: what the stack has for that list, in its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, Scalar, Sequence

CODES = {
    "KYB157": "A stack that has nothing for the list in which it stands.",
}
LISTS = ("estimators", "processors", "supervisors")

Named = Callable[[Scalar], Mapping | None]
"""Gives the whole stack of a name; None, and a finding, where there is none."""


def with_stacks(body: Mapping, named: Named, found: list[Diagnostic]) -> Mapping:
    """A vehicle, or a stack, with every stack in its lists replaced by its parts. One without any
    stays the same object."""
    entries: dict[str, Entry] = {}
    for key in LISTS:
        entry = body.entries.get(key)
        node = None if entry is None else entry.value
        if entry is not None and isinstance(node, Sequence) and any(map(stack_of, node.items)):
            items = tuple(_items(key, node, named, found))
            entries[key] = entry._replace(value=Sequence(items, node.span))
    return Mapping({**body.entries, **entries}, body.span) if entries else body


def stack_of(item: Node) -> Scalar | None:
    """The name of the stack that an item of a list stands for; None for a part."""
    name = item.get("stack") if isinstance(item, Mapping) else None
    return name if isinstance(name, Scalar) else None


def _items(key: str, written: Sequence, named: Named, found: list[Diagnostic]) -> Iterator[Node]:
    for item in written.items:
        name = stack_of(item)
        if name is None:
            yield item
            continue
        stack = named(name)
        parts = None if stack is None else stack.get(key)
        if isinstance(parts, Sequence):
            yield from parts.items
        elif stack is not None:
            others = " and ".join(other for other in LISTS if stack.get(other) is not None)
            message, hint = f"the stack `{name.text}` has no {key}", f"it has {others or 'nothing'}"
            found.append(Diagnostic("KYB157", message, name.span, help=hint))
