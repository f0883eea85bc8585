"""The mission's inputs on the chosen target: each its own, or the target's in its place."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import InputEntry
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of, is_null
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.shaping.parts import PartDecoder

CODES = {
    "KYB400": "A target replaces an input that the mission doesn't have, or a vehicle is called "
    "`inputs`, which a target needs for itself.",
}
SILENT_AFTER = 0.3
"""Seconds."""
_KEYS = frozenset({"buttons", "dead_man", "silent_after", "stuck_after"})


def inputs_of(root: Mapping, target: Text, uses: PartDecoder) -> Diagnosed[dict[str, InputEntry]]:
    """The inputs by name; one with errors is left out."""
    own, targets = entries_of(root.get("inputs")), entries_of(root.get("targets"))
    for name in targets:
        yield from _without_place(own, targets[name].value, root)
    replaced = _replacing(targets[target.text].value) if target.text in targets else {}
    found: dict[str, InputEntry] = {}
    for name, entry in own.items():
        other = replaced.get(name)
        value = entry.value if other is None or is_null(other.value) else other.value
        if not is_null(value):
            one = yield from _input(entry.key, value, uses)
            if one is not None:
                found[name] = one
    for name, entry in own.items() if replaced else ():
        if name in replaced and not is_null(entry.value):  # judged too, though it isn't used
            yield from uses.one("inputs", entry.value, _KEYS)
    return found


def other_inputs(entries: dict[str, MappingEntry], uses: PartDecoder) -> Iterator[Diagnostic]:
    """What is wrong with the inputs of a target that is not flown on."""
    for entry in entries_of(entries["inputs"].value if "inputs" in entries else None).values():
        if not is_null(entry.value):
            yield from uses.one("inputs", entry.value, _KEYS)


def _without_place(
    own: dict[str, MappingEntry], target: Node, root: Mapping
) -> Iterator[Diagnostic]:
    for name, entry in _replacing(target).items():
        if name not in own:
            message = f"the mission has no input `{name}`"
            hint = did_you_mean(name, own) or f"write `inputs: {{{name}: {{use: ...}}}}` in it"
            yield Diagnostic("KYB400", message, entry.key.span, label="unknown", help=hint)
    vehicles = entries_of(root.get("vehicles"))
    if "inputs" in vehicles:
        message, hint = "a vehicle can't be called `inputs`", "give it another name"
        yield Diagnostic("KYB400", message, vehicles["inputs"].key.span, help=hint)


def _replacing(target: Node) -> dict[str, MappingEntry]:
    return entries_of(target.get("inputs")) if isinstance(target, Mapping) else {}


def _input(name: Scalar, node: Node, uses: PartDecoder) -> Diagnosed[InputEntry | None]:
    part = yield from uses.one("inputs", node, _KEYS)
    if part is None:
        return None
    body = node if isinstance(node, Mapping) else Mapping({}, node.span)
    silent = yield from _duration(body, "silent_after")
    stuck = yield from _duration(body, "stuck_after")
    dead_man = body.get("dead_man")
    renamed = entries_of(body.get("buttons")).values()
    return InputEntry(
        name.as_text,
        part,
        SILENT_AFTER if silent is None else silent,
        part.spec.cls.stuck_after if stuck is None else stuck,
        dead_man.as_text if isinstance(dead_man, Scalar) and not dead_man.is_null else None,
        tuple((e.key.as_text, e.value.as_text) for e in renamed if isinstance(e.value, Scalar)),
        {key: body.entries[key].value.span for key in _KEYS & body.entries.keys()},
    )


def _duration(body: Mapping, key: str) -> Diagnosed[float | None]:
    node = body.get(key)
    if node is None or is_null(node):
        return None
    value: float | None = yield from decode(node, quantity_field(key, DURATION, above=0.0))
    return value
