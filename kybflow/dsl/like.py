"""`like`: start from another entry. Mappings merge, lists are replaced, `null` removes. That is the
whole rule."""

from __future__ import annotations

from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar

CODES = {
    "KYB124": "`like`, `airframe`, `stack`, `world` or `do: chain.` names what doesn't exist.",
    "KYB125": "Entries that are `like` each other in a circle, or stacks that hold each other.",
    "KYB126": "More values than a mission may have, counted after `like`.",
    "KYB129": "A behavior that is removed, and that `like` does not bring (a warning).",
}


def merge(base: Mapping, own: Mapping) -> Mapping:
    """`own` over `base`. What comes from `base` alone is marked inherited; the order is that of
    `base`, then what `own` adds."""
    entries = {key: entry._replace(inherited=True) for key, entry in base.entries.items()}
    for key, entry in own.entries.items():
        under = entries.get(key)
        if _removes(entry.value):
            entries.pop(key, None)
        elif under is not None and isinstance(under.value, Mapping):
            entries[key] = Entry(entry.key, _over(under.value, entry.value))
        else:
            entries[key] = Entry(entry.key, _over(None, entry.value))
    return Mapping(entries, own.span)


def _over(under: Mapping | None, value: Node) -> Node:
    if not isinstance(value, Mapping):
        return value
    if under is not None:
        return merge(under, value)
    return merge(Mapping({}, value.span), value) if _has_null(value) else value


def _has_null(value: Mapping) -> bool:
    """Whether there is anything to remove; a node without keeps being shared."""
    return any(
        _removes(entry.value) or (isinstance(entry.value, Mapping) and _has_null(entry.value))
        for entry in value.entries.values()
    )


def _removes(value: Node) -> bool:
    return isinstance(value, Scalar) and value.is_null
