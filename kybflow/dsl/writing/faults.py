"""Faults of the document as YAML that reads back as the same."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.units import DURATION
from kybflow.dsl.document import Document, FaultUse
from kybflow.dsl.writing.values import Line, origin, parameters, place, quantity, quoted


def fault_lines(document: Document) -> Iterator[Line]:
    """`faults:` with each on a line; nothing where there is none."""
    if document.faults:
        yield "faults:", place(document.spans.get("faults"))
    for fault in document.faults:
        values = origin(fault.part).removeprefix(fault.part.span.at)
        yield f"  - {_fault(fault)}", fault.span.at + values


def _fault(fault: FaultUse) -> str:
    pairs = [f"on: {fault.vehicle.text}", f"inject: {fault.part.spec.name}"]
    if fault.time is not None:
        pairs.insert(0, f"at: {quantity(fault.time, DURATION)}")
    if fault.when is not None:
        pairs.insert(0, f"when: {quoted(fault.when.text)}")
    if fault.duration is not None:
        pairs.append(f"for: {quantity(fault.duration, DURATION)}")
    return "{" + ", ".join((*pairs, *parameters(fault.part))) + "}"
