"""`on:` and `faults:` of the tree to the document: events, filters and actions as written, and what
breaks when."""

from __future__ import annotations

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import ActionEntry, CallbackEntry, FaultEntry, PartUse
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    describe,
    entries_of,
    head_of,
    is_null,
    items_of,
)
from kybflow.dsl.shaping.entry_values import goal_of
from kybflow.dsl.shaping.parts import PartDecoder, params_of
from kybflow.dsl.shaping.states import duration
from kybflow.parts.action import BUILT_IN

CODES = {
    "KYB170": "An action that neither the language nor an installed package has.",
    "KYB171": "A callback that does nothing, or an action that is not one key with a value.",
    "KYB461": "A callback that says neither an event nor a condition, or what needs the other one.",
    "KYB180": "A fault that does not say when, or says it twice.",
}
_CALLBACK_KEYS = frozenset({"event", "when", "for", "do"})


def callbacks(node: Node | None, uses: PartDecoder) -> Diagnosed[tuple[CallbackEntry, ...]]:
    """The callbacks of `on:`."""
    items = (item for item in items_of(node) if isinstance(item, Mapping))
    return tuple((yield from every(_callback(item, uses) for item in items)))


def _callback(node: Mapping, uses: PartDecoder) -> Diagnosed[CallbackEntry]:
    event, when, items = node.get("event"), node.get("when"), items_of(node.get("do"))
    yield from _occasion(node)
    if not items:
        told = f"when `{event.text}` is heard" if isinstance(event, Scalar) else "here"
        message = f"nothing is done {told}"
        yield Diagnostic("KYB171", message, head_of(node), help="write `do: [...]`")
    hold = yield from duration(node, "for")
    actions = yield from every(_actions(item, uses) for item in items)
    return CallbackEntry(
        event=event.as_text if isinstance(event, Scalar) else None,
        fields=tuple(
            (entry.key.as_text, entry.value.as_text)
            for key, entry in node.entries.items()
            if key not in _CALLBACK_KEYS
            and isinstance(entry.value, Scalar)
            and not entry.value.is_null
        ),
        when=when.as_text if isinstance(when, Scalar) else None,
        actions=tuple(action for several in actions for action in several),
        span=node.span,
        hold=hold or 0.0,
    )


def _occasion(node: Mapping) -> Diagnosed[None]:
    """What is wrong with when a callback is answered."""
    if node.get("event") is not None:
        if node.get("for") is not None:
            message, hint = (
                "an event has no duration",
                "`for` belongs to a `when` without an `event`",
            )
            yield Diagnostic("KYB461", message, node.entries["for"].key.span, help=hint)
        return
    if node.get("when") is None:
        hint = "write `event: NAME`, `when: CONDITION`, or both"
        yield Diagnostic("KYB461", "nothing says when this is done", head_of(node), help=hint)
    for key, entry in node.entries.items():
        if key not in _CALLBACK_KEYS and not is_null(entry.value):
            message = f"`{key}` asks for a field of an event, and there is none"
            hint = "add `event: NAME`, or ask for it in the `when`"
            yield Diagnostic("KYB461", message, entry.key.span, help=hint)


def _actions(node: Node, uses: PartDecoder) -> Diagnosed[list[ActionEntry]]:
    """The actions of one item: `switch` and `set` may name several things."""
    if not isinstance(node, Mapping) or len(node.entries) != 1:
        hint = "write each as an item of its own: `do: [{log: hello}, {emit: ready}]`"
        message = "an action is one key with its value"
        yield Diagnostic("KYB171", message, head_of(node), help=hint)
        return []
    [entry] = node.entries.values()
    name = entry.key.text
    if name not in BUILT_IN:
        part = yield from _part(entry, uses)
        return [] if part is None else [ActionEntry(entry.key.as_text, None, None, part)]
    if isinstance(entry.value, Mapping):
        return (yield from named_values(entry))
    if isinstance(entry.value, Scalar) and not entry.value.is_null:
        return [ActionEntry(entry.key.as_text, None, entry.value.as_text)]
    yield Diagnostic("KYB171", f"`{name}` says nothing", entry.key.span)
    return []


def named_values(entry: MappingEntry) -> Diagnosed[list[ActionEntry]]:
    """The actions of `{set: {NAME: VALUE, ...}}`: one for each name."""
    actions: list[ActionEntry] = []
    for target in entries_of(entry.value).values():
        value = target.value
        if is_null(value):
            yield Diagnostic("KYB171", f"`{target.key.text}` has no value", target.key.span)
            continue
        said: Node | Text = value
        values = None
        if entry.key.text == "switch":
            goal = yield from goal_of(target)
            if goal is None:
                continue
            said, values = goal
        elif entry.key.text != "set" and isinstance(value, Scalar):
            said = value.as_text
        key, name = entry.key.as_text, target.key.as_text
        actions.append(ActionEntry(key, name, said, values=values))
    return actions


def _part(entry: MappingEntry, uses: PartDecoder) -> Diagnosed[PartUse | None]:
    """An action of a package; its value is its parameters."""
    name, known = entry.key, uses.catalog.names("actions")
    if name.text not in known:
        hint = did_you_mean(name.text, (*BUILT_IN, *known))
        yield Diagnostic("KYB170", f"no action is called `{name.text}`", name.span, help=hint)
        return None
    if not isinstance(entry.value, Mapping) and not is_null(entry.value):
        message = f"`{name.text}` must be a mapping, but this is {describe(entry.value)}"
        hint = f"write its parameters: `{{{name.text}: {{...}}}}`"
        yield Diagnostic("KYB103", message, entry.value.span, help=hint)
        return None
    spec = yield from uses.spec("actions", name)
    body = entry.value if isinstance(entry.value, Mapping) else Mapping({}, name.span)
    if spec is None:
        return None
    params = yield from params_of(spec.params, body, spec.name, name.span)
    if params is None:
        return None
    spans = {key: own.value.span for key, own in body.entries.items()}
    return PartUse(name.as_text, spec, params, name.text, name.span, spans)


_FAULT_KEYS = frozenset({"at", "when", "on", "for"})


def faults_of(node: Node | None, uses: PartDecoder) -> Diagnosed[tuple[FaultEntry, ...]]:
    """The faults of `faults:`; one with errors is left out."""
    items = (item for item in items_of(node) if isinstance(item, Mapping))
    decoded = yield from every(_fault(item, uses) for item in items)
    return tuple(fault for fault in decoded if fault is not None)


def _fault(node: Mapping, uses: PartDecoder) -> Diagnosed[FaultEntry | None]:
    vehicle, when = node.get("on"), node.get("when")
    assert isinstance(vehicle, Scalar)
    at = yield from duration(node, "at")
    lasts = yield from duration(node, "for", above=0.0)
    if (node.get("at") is None) is (when is None):
        both = when is not None
        name = node.get("inject")
        what = f"`{name.text}`" if isinstance(name, Scalar) else "a fault"
        message = f"{what} says twice when" if both else f"nothing says when {what} is injected"
        span = node.entries["when"].key.span if both else head_of(node)
        yield Diagnostic("KYB180", message, span, help="write one: `at: 20 s` or `when: CONDITION`")
    part = yield from uses.one("faults", node, _FAULT_KEYS, "inject")
    if part is None:
        return None
    text = when.as_text if isinstance(when, Scalar) else None
    return FaultEntry(part, vehicle.as_text, at, text, lasts, part.span)
