"""Callbacks of the document as YAML that reads back as the same."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.document import ActionUse, Callback, Document
from kybflow.dsl.reading.nodes import Node, Scalar, Sequence
from kybflow.dsl.writing.values import Line, parameters, place, quoted


def callback_lines(document: Document) -> Iterator[Line]:
    """`on:` with each callback on a line; nothing where there is none."""
    if document.callbacks:
        yield "on:", place(document.spans.get("on"))
    for callback in document.callbacks:
        yield f"  - {_callback(callback)}", callback.span.at


def _callback(callback: Callback) -> str:
    pairs = [f"event: {quoted(callback.event.text)}"]
    pairs += [f"{field.text}: {quoted(value.text)}" for field, value in callback.fields]
    if callback.when is not None:
        pairs.append(f"when: {quoted(callback.when.text)}")
    actions = ", ".join(_action(action) for action in callback.actions)
    return "{" + ", ".join((*pairs, f"do: [{actions}]")) + "}"


def _action(action: ActionUse) -> str:
    if action.part is not None:
        return f"{{{action.name.text}: {{{', '.join(parameters(action.part))}}}}}"
    value = action.value if action.name.text == "set" else quoted(action.value.text)
    said = value if isinstance(value, str) else option_value(value)
    if action.target is not None:
        said = f"{{{action.target.text}: {said}}}"
    return f"{{{action.name.text}: {said}}}"


def option_value(node: Node) -> str:
    """An option's value as it was written."""
    if isinstance(node, Sequence):
        return "[" + ", ".join(option_value(item) for item in node.items) + "]"
    return quoted(node.text) if isinstance(node, Scalar) else ""
