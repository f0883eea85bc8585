"""`faults:` of the tree to the document's."""

from __future__ import annotations

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.document import FaultUse
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, head_of, items_of
from kybflow.dsl.shaping.arrows import duration
from kybflow.dsl.shaping.uses import Uses

CODES = {
    "KYB180": "A fault that does not say when, or says it twice.",
}
_OWN = frozenset({"at", "when", "on", "for"})


def faults_of(node: Node | None, uses: Uses) -> Diagnosed[tuple[FaultUse, ...]]:
    """The faults of `faults:`; one with errors is left out."""
    items = (item for item in items_of(node) if isinstance(item, Mapping))
    decoded = yield from every(_fault(item, uses) for item in items)
    return tuple(fault for fault in decoded if fault is not None)


def _fault(node: Mapping, uses: Uses) -> Diagnosed[FaultUse | None]:
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
    part = yield from uses.one("faults", node, _OWN, "inject")
    if part is None:
        return None
    text = when.as_text if isinstance(when, Scalar) else None
    return FaultUse(part, vehicle.as_text, at, text, lasts, part.span)
