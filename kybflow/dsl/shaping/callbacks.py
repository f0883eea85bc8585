"""`on:` of the tree to the document's callbacks: events, filters, actions as written."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean
from kybflow.dsl.document import ActionUse, Callback, PartUse
from kybflow.dsl.reading.nodes import (
    Entry,
    Mapping,
    Node,
    Scalar,
    describe,
    entries_of,
    head_of,
    is_null,
    items_of,
)
from kybflow.dsl.reading.source import Text
from kybflow.dsl.schema.explain_commas import cut_by_yaml
from kybflow.parts.action import BUILT_IN

if TYPE_CHECKING:
    from kybflow.dsl.shaping.uses import Uses

CODES = {
    "KYB170": "An action that neither the language nor an installed package has.",
    "KYB171": "A callback that does nothing, or an action that is not one key with a value.",
}
_OWN = frozenset({"event", "when", "do"})


def callbacks(node: Node | None, uses: Uses) -> tuple[Callback, ...]:
    """The callbacks of `on:`; what is wrong with their actions goes to the findings of `uses`."""
    items = items_of(node)
    return tuple(_callback(item, uses) for item in items if isinstance(item, Mapping))


def _callback(node: Mapping, uses: Uses) -> Callback:
    event, when, do = node.get("event"), node.get("when"), node.get("do")
    assert isinstance(event, Scalar)
    items = items_of(do)
    if not items:
        message = f"nothing is done when `{event.text}` is heard"
        uses.found.append(Diagnostic("KYB171", message, head_of(node), help="write `do: [...]`"))
    return Callback(
        event=event.as_text,
        fields=tuple(
            (entry.key.as_text, entry.value.as_text)
            for key, entry in node.entries.items()
            if key not in _OWN and isinstance(entry.value, Scalar) and not entry.value.is_null
        ),
        when=when.as_text if isinstance(when, Scalar) else None,
        actions=tuple(action for item in items for action in _actions(item, uses)),
        span=node.span,
    )


def _actions(node: Node, uses: Uses) -> Iterator[ActionUse]:
    """The actions of one item: `switch` and `set` may name several things."""
    if not isinstance(node, Mapping) or len(node.entries) != 1:
        last = next(reversed(entries_of(node)), "")
        cut = cut_by_yaml(node, last, BUILT_IN) if isinstance(node, Mapping) and last else None
        if cut is not None:
            uses.found.append(cut)
            return
        hint = "write each as an item of its own: `do: [{log: hello}, {emit: ready}]`"
        message = "an action is one key with its value"
        uses.found.append(Diagnostic("KYB171", message, head_of(node), help=hint))
        return
    [entry] = node.entries.values()
    name = entry.key.text
    if name not in BUILT_IN:
        part = _part(entry, uses)
        if part is not None:
            yield ActionUse(entry.key.as_text, None, None, part)
    elif isinstance(entry.value, Mapping):
        yield from named_values(entry, uses.found)
    elif isinstance(entry.value, Scalar) and not entry.value.is_null:
        yield ActionUse(entry.key.as_text, None, entry.value.as_text)
    else:
        message = f"`{name}` says nothing"
        uses.found.append(Diagnostic("KYB171", message, entry.key.span))


def named_values(entry: Entry, found: list[Diagnostic]) -> Iterator[ActionUse]:
    """The actions of `{set: {NAME: VALUE, ...}}`: one for each name."""
    for target in entry.value.entries.values() if isinstance(entry.value, Mapping) else ():
        value = target.value
        if isinstance(value, Scalar) and value.is_null:
            message = f"`{target.key.text}` has no value"
            found.append(Diagnostic("KYB171", message, target.key.span))
            continue
        said: Node | Text = value
        if entry.key.text != "set" and isinstance(value, Scalar):
            said = value.as_text
        yield ActionUse(entry.key.as_text, target.key.as_text, said)


def _part(entry: Entry, uses: Uses) -> PartUse | None:
    """An action of a package; its value is its parameters."""
    name, known = entry.key, uses.catalog.names("actions")
    if name.text not in known:
        message = f"no action is called `{name.text}`"
        hint = did_you_mean(name.text, (*BUILT_IN, *known))
        uses.found.append(Diagnostic("KYB170", message, name.span, help=hint))
        return None
    if not isinstance(entry.value, Mapping) and not is_null(entry.value):
        message = f"`{name.text}` must be a mapping, but this is {describe(entry.value)}"
        hint = f"write its parameters: `{{{name.text}: {{...}}}}`"
        uses.found.append(Diagnostic("KYB103", message, entry.value.span, help=hint))
        return None
    spec = uses.spec("actions", name)
    body = entry.value if isinstance(entry.value, Mapping) else Mapping({}, name.span)
    params = None if spec is None else uses.params(spec.params, body, spec.name, name.span)
    if spec is None or params is None:
        return None
    spans = {key: own.value.span for key, own in body.entries.items()}
    return PartUse(name.as_text, spec, params, name.text, name.span, spans)
