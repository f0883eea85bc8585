"""`faults:` of the tree to the document's."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import FaultUse
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, head_of, items_of
from kybflow.dsl.shaping.arrows import duration

if TYPE_CHECKING:
    from kybflow.dsl.shaping.uses import Uses

CODES = {
    "KYB180": "A fault that does not say when, or says it twice.",
}
_OWN = frozenset({"at", "when", "on", "for"})


def faults_of(node: Node | None, uses: Uses) -> tuple[FaultUse, ...]:
    """The faults of `faults:`; what is wrong with them goes to the findings of `uses`."""
    decoded = (_fault(item, uses) for item in items_of(node) if isinstance(item, Mapping))
    return tuple(fault for fault in decoded if fault is not None)


def _fault(node: Mapping, uses: Uses) -> FaultUse | None:
    vehicle, when = node.get("on"), node.get("when")
    assert isinstance(vehicle, Scalar)
    at = duration(node, "at", uses.found)
    lasts = duration(node, "for", uses.found, above=0.0)
    if (node.get("at") is None) is (when is None):
        both = when is not None
        name = node.get("inject")
        what = f"`{name.text}`" if isinstance(name, Scalar) else "a fault"
        message = f"{what} says twice when" if both else f"nothing says when {what} is injected"
        span = node.entries["when"].key.span if both else head_of(node)
        hint = "write one: `at: 20 s` or `when: CONDITION`"
        uses.found.append(Diagnostic("KYB180", message, span, help=hint))
    part = uses.one("faults", node, _OWN, "inject")
    if part is None:
        return None
    return FaultUse(
        part=part,
        vehicle=vehicle.as_text,
        time=at,
        when=when.as_text if isinstance(when, Scalar) else None,
        duration=lasts,
        span=part.span,
    )
