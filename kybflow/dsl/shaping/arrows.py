"""One item of `next`, a way out of a behavior or of a phase, from the tree to the document."""

from __future__ import annotations

from kybflow.core.units import DURATION
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.document import Transition
from kybflow.dsl.reading.nodes import Mapping, Scalar
from kybflow.dsl.reading.values import decode, quantity_field

CODES = {
    "KYB143": "A transition that says nothing of when, or how long of nothing.",
}


def next_arrow(node: Mapping) -> Diagnosed[Transition]:
    """The arrow that an item of `next` is; its shape is judged already."""
    when, event, goal = node.get("when"), node.get("event"), node.get("go")
    assert isinstance(goal, Scalar)
    if when is None and event is None and node.get("after") is None:
        message = f"nothing says when to go to `{goal.text}`"
        hint = "add `when: CONDITION`, `event: NAME` or `after: 10 s`"
        yield Diagnostic("KYB143", message, goal.span, help=hint)
    elif when is None and node.get("for") is not None:
        message = f"nothing says what must hold before it goes to `{goal.text}`"
        span, hint = node.entries["for"].key.span, "`for` belongs to a `when`"
        yield Diagnostic("KYB143", message, span, help=hint)
    after = yield from duration(node, "after")
    hold = yield from duration(node, "for")
    return Transition(
        "next",
        goal.as_text,
        node.span,
        when=when.as_text if isinstance(when, Scalar) else None,
        event=event.as_text if isinstance(event, Scalar) else None,
        after=after,
        hold=hold or 0.0,
    )


def duration(keys: Mapping, key: str, above: float | None = None) -> Diagnosed[float | None]:
    """The seconds of `key`; None when it is not written or has errors."""
    node = keys.get(key)
    if node is None:
        return None
    at_least = 0.0 if above is None else None
    field = quantity_field(key, DURATION, above=above, at_least=at_least)
    value: float | None = yield from decode(node, field)
    return value
