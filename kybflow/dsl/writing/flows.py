"""Groups and flows of the document as YAML that reads back as the same."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.units import DURATION
from kybflow.dsl.document import Document, Flow, Phase
from kybflow.dsl.reading.source import Text
from kybflow.dsl.writing.callbacks import option_value
from kybflow.dsl.writing.values import Line, place, quantity, quoted, way


def flow_lines(document: Document) -> Iterator[Line]:
    """`groups:` and `flows:`, each group and each phase on a line; nothing where there is none."""
    if document.groups:
        yield "groups:", place(document.spans.get("groups"))
    for name, members in document.groups.items():
        inside = ", ".join(member.text for member in members)
        yield f"  {name}: [{inside}]", document.group_spans[name].at
    if document.flows:
        yield "flows:", place(document.spans.get("flows"))
    for flow in document.flows.values():
        yield from _flow(flow)


def _flow(flow: Flow) -> Iterator[Line]:
    yield f"  {flow.name.text}:", flow.span.at
    yield f"    begin: {flow.begin.text}", flow.begin.span.at
    yield "    phases:", flow.span.at
    for phase in flow.phases.values():
        yield f"      {phase.name.text}: {_phase(phase)}", phase.span.at


def _phase(phase: Phase) -> str:
    options = [f"{a.target.text}: {option_value(a.value)}" for a in phase.set if a.target]
    pairs = [_pairs("give", phase.give), _pairs("run", phase.run)]
    pairs.insert(1, f"set: {{{', '.join(options)}}}" if options else "")
    ways = [way(arrow) for arrow in phase.transitions if arrow.cause == "next"]
    pairs.append(f"next: [{', '.join(ways)}]" if ways else "")
    for arrow in phase.transitions:
        if arrow.cause == "within" and arrow.after is not None:
            limit = quantity(arrow.after, DURATION)
            pairs.append(f"within: {limit}, otherwise: {quoted(arrow.target.text)}")
    return "{" + ", ".join(pair for pair in pairs if pair) + "}"


def _pairs(key: str, pairs: tuple[tuple[Text, Text], ...]) -> str:
    inside = ", ".join(f"{who.text}: {quoted(goal.text)}" for who, goal in pairs)
    return f"{key}: {{{inside}}}" if pairs else ""
