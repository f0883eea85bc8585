"""`like`: start from another entry. Mappings merge, lists are replaced, `null` removes. That is the
whole rule."""

from __future__ import annotations

from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, Sequence, is_null

CODES = {
    "KYB124": "`like`, `airframe`, `stack`, `world` or `do: chain.` names what doesn't exist.",
    "KYB125": "Entries that are `like` each other in a cycle, or stacks that hold each other.",
    "KYB126": "More values than a mission may have, counted after `like`.",
    "KYB129": "A behavior or phase that is removed, and that `like` does not bring (a warning).",
}
Places = tuple[Span, ...]
"""Where something is used, outermost first."""


def merge(base: Mapping, own: Mapping, used: Places = ()) -> Mapping:
    """`own` over `base`. What comes from `base` alone is marked inherited, and `used` there; the
    order is that of `base`, then what `own` adds."""
    entries = {
        key: MappingEntry(entry.key, entry.value, True, (*used, *entry.used), entry.depth + 1)
        for key, entry in base.entries.items()
    }
    for key, entry in own.entries.items():
        under, value = entries.get(key), entry.value
        if is_null(value):
            entries.pop(key, None)
            continue
        if isinstance(value, Mapping):
            if under is not None and isinstance(under.value, Mapping):
                value = merge(under.value, value, under.used)
            elif _has_null(value):
                value = merge(Mapping({}, value.span), value)
        entries[key] = MappingEntry(entry.key, value)
    return Mapping(entries, own.span)


def _has_null(value: Mapping) -> bool:
    """Whether there is anything to remove; a node without keeps being shared."""
    return any(
        is_null(entry.value) or (isinstance(entry.value, Mapping) and _has_null(entry.value))
        for entry in value.entries.values()
    )


class UseMarker:
    """Copies nodes, whose spans say then where `like` brought them to; what an alias shares stays
    shared."""

    def __init__(self) -> None:
        self._done: dict[tuple[int, Places], tuple[Node, Node]] = {}

    def marked(self, node: Node, used: Places = ()) -> Node:
        """`node`, which is used at the places `used`, with these in every span."""
        key = (id(node), used)
        if key not in self._done:
            self._done[key] = (node, self._copied(node, used))
        return self._done[key][1]

    def _copied(self, node: Node, used: Places) -> Node:
        span = node.span._replace(used=used) if used else node.span
        if isinstance(node, Scalar):
            return node._replace(span=span) if used else node
        if isinstance(node, Sequence):
            items = tuple(self.marked(item, used) for item in node.items) if used else node.items
            return Sequence(items, span)
        entries: dict[str, MappingEntry] = {}
        for name, entry in node.entries.items():
            places, key = (*used, *entry.used), entry.key
            if places:
                key = key._replace(span=key.span._replace(used=places))
            value = self.marked(entry.value, places)
            entries[name] = MappingEntry(key, value, entry.inherited, depth=entry.depth)
        return Mapping(entries, span)
