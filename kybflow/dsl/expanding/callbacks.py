"""Decode `on:` and `faults:`: when a callback runs and when a fault begins, and the actions of a
callback, one for each target."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from kybflow.core.params import fields_of
from kybflow.core.text import did_you_mean
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.source import Source
from kybflow.dsl.plan import ActionKeys, CallbackPlan, FaultPlan, PartPlan
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    describe,
    entries_of,
    head_of,
    is_null,
    items_of,
)
from kybflow.parts.action import BUILT_IN

CODES = {
    "KYB170": "An action that neither the language nor an installed package has.",
    "KYB171": "A callback that does nothing, or an action that is not one key with a value.",
    "KYB461": "A callback with neither an event nor a condition, or a key that needs the other "
    "one.",
    "KYB180": "A fault without a time and a condition, or with both.",
}
_CALLBACK_KEYS = frozenset(field.key for field in fields_of(CallbackPlan))


def callbacks_of(node: Node | None, decoder: Decoder) -> tuple[CallbackPlan, ...]:
    """Return the callbacks of `on:`, without those that have errors."""
    callbacks = (_callback(item, decoder) for item in items_of(node) if isinstance(item, Mapping))
    return tuple(callback for callback in callbacks if callback is not None)


def _callback(node: Mapping, decoder: Decoder) -> CallbackPlan | None:
    event, items, found = node.get("event"), items_of(node.get("do")), decoder.found
    asked = [
        entry
        for key, entry in node.entries.items()
        if key not in _CALLBACK_KEYS and not is_null(entry.value)
    ]
    if event is not None and node.get("for") is not None:
        hint = "`for` belongs to a `when` without an `event`"
        span = node.entries["for"].key.span
        found.report("KYB461", "an event has no duration", span, help=hint)
    elif event is None and node.get("when") is None:
        hint = "write `event: NAME`, `when: CONDITION`, or both"
        message = "the callback has neither `event` nor `when`"
        found.report("KYB461", message, head_of(node), help=hint)
    for entry in asked if event is None else ():
        message = f"`{entry.key.text}` is a field of an event, but there is no `event`"
        hint = "add `event: NAME`, or ask for it in the `when`"
        found.report("KYB461", message, entry.key.span, help=hint)
    if not items:
        what = f"callback of `{event.text}`" if isinstance(event, Scalar) else "callback"
        message = f"the {what} has no action"
        found.report("KYB171", message, head_of(node), help="write `do: [...]`")
    for entry in asked:
        decoder.misplaced(entry.value, entry.key.text)
    fields = tuple((e.key.text, e.value.text) for e in asked if isinstance(e.value, Scalar))
    actions = tuple(action for item in items for action in _actions(item, decoder))
    own: dict[str, Any] = {"event": ""} if event is None else {}
    callback: CallbackPlan | None = decoder.record(
        CallbackPlan, node, node.span, fields=fields, do=actions, vehicles=(), actions=(), **own
    )
    return callback


def _actions(node: Node, decoder: Decoder) -> Iterator[ActionKeys]:
    """Yield the actions of one item; `switch`, `set` and `perform` may have several targets."""
    found = decoder.found
    if not isinstance(node, Mapping) or len(node.entries) != 1:
        hint = "write each as an item of its own: `do: [{log: hello}, {emit: ready}]`"
        found.report("KYB171", "an action is one key with its value", head_of(node), help=hint)
        return
    [entry] = node.entries.values()
    name, value = entry.key.text, entry.value
    source = Source(entry.key.span, node)
    if name not in BUILT_IN:
        part = _part(entry, decoder)
        if part is not None:
            yield ActionKeys(name=name, part=part, source=source)
    elif isinstance(value, Mapping):
        yield from _targeted(entry, decoder)
    elif isinstance(value, Scalar) and not value.is_null:
        yield ActionKeys(name=name, value=value.text, source=source)
    elif isinstance(value, Sequence):
        decoder.misplaced(value, name)
    else:
        found.report("KYB171", f"`{name}` has no value", entry.key.span)


def _targeted(entry: MappingEntry, decoder: Decoder) -> Iterator[ActionKeys]:
    """Yield the actions of `{set: {NAME: VALUE, ...}}`, one for each target."""
    name = entry.key.text
    for target in entries_of(entry.value).values():
        value: Any = None
        key = target.key
        if is_null(target.value):
            decoder.found.report("KYB171", f"`{key.text}` has no value", key.span)
        elif name == "set":
            value = target.value
        elif name == "switch":
            value = decoder.request(target)
        elif not decoder.misplaced(target.value, key.text) and isinstance(target.value, Scalar):
            value = target.value.text
        if value is not None:
            source = Source(key.span, Mapping({key.text: target}, key.span))
            yield ActionKeys(name=name, target=key.text, value=value, source=source)


def _part(entry: MappingEntry, decoder: Decoder) -> PartPlan | None:
    """Return an action of a package, whose value is the mapping of its parameters; None if it has
    errors."""
    name, known, found = entry.key, decoder.catalog.names("actions"), decoder.found
    if name.text not in known:
        hint = did_you_mean(name.text, (*BUILT_IN, *known))
        found.report("KYB170", f"no action is called `{name.text}`", name.span, help=hint)
        return None
    if not isinstance(entry.value, Mapping) and not is_null(entry.value):
        message = f"`{name.text}` must be a mapping, but this is {describe(entry.value)}"
        hint = f"write its parameters: `{{{name.text}: {{...}}}}`"
        found.report("KYB103", message, entry.value.span, help=hint)
        return None
    body = entry.value if isinstance(entry.value, Mapping) else Mapping({}, name.span)
    return decoder.named_part("actions", name, body, f"actions.{name.text}")


def faults_of(node: Node | None, decoder: Decoder) -> tuple[FaultPlan, ...]:
    """Return the faults of `faults:`, without those that have errors."""
    faults = (_fault(item, decoder) for item in items_of(node) if isinstance(item, Mapping))
    return tuple(fault for fault in faults if fault is not None)


def _fault(node: Mapping, decoder: Decoder) -> FaultPlan | None:
    at, when, name = node.get("at"), node.get("when"), node.get("inject")
    if (at is None) is (when is None):
        both = when is not None
        what = f"`{name.text}`" if isinstance(name, Scalar) else "a fault"
        message = f"{what} has {'both `at` and' if both else 'neither `at` nor'} `when`"
        span = name.span if isinstance(name, Scalar) else head_of(node)
        span = node.entries["when"].key.span if both else span
        hint = "write one: `at: 20 s` or `when: CONDITION`"
        decoder.found.report("KYB180", message, span, help=hint)
    fault: FaultPlan | None = decoder.record(FaultPlan, node, node.span)
    if fault is None:
        return None
    span = fault.part.span
    return fault.but(at=span.at, source=fault.source._replace(span=span))
