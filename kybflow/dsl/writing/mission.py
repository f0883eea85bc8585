"""The mission after everything, as YAML: no import, no `like`, no parameter, every default written,
and where each line came from. Reading it back gives the same plan."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping as MappingOf
from typing import Any

from kybflow.core.params import fields_of
from kybflow.core.units import DURATION, FREQUENCY, LENGTH, NUMBER
from kybflow.dsl.diagnostics.spans import PREFIX, Text
from kybflow.dsl.document import (
    ActionEntry,
    CallbackEntry,
    Document,
    FaultEntry,
    FlowEntry,
    ObstacleEntry,
    PhaseEntry,
    SensorEntry,
)
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence
from kybflow.dsl.resolving.imports import without_homes
from kybflow.dsl.schema.world import GridParams, MovingSphereParams, TagParams
from kybflow.dsl.writing.values import (
    YamlLine,
    origin,
    parameters,
    part,
    place,
    quantity,
    quoted,
    vector,
    way,
    written_fields,
)
from kybflow.dsl.writing.vehicle import vehicle_lines
from kybflow.world.shapes import Box, Cylinder, Plane, Scanned, Sphere


def to_yaml(document: Document) -> str:
    """The text, each line with its origin as a comment."""
    lines = list(_mission(document))
    width = min(max(len(line) for line, _ in lines), 76)
    return "".join(
        f"{line:<{width}}  # {without_homes(came_from) or 'default'}\n" if line.strip() else "\n"
        for line, came_from in lines
    )


def _mission(document: Document) -> Iterator[YamlLine]:
    at = {key: span.at for key, span in document.spans.items()}
    yield "kybflow: 1", at["kybflow"]
    yield f"mission: {quoted(document.mission.text)}", at["mission"]
    if document.summary:
        yield f"summary: {quoted(document.summary)}", at["summary"]
    yield f"control: {quantity(float(document.control_rate), FREQUENCY)}", at.get("control", "")
    yield f"hover_limit: {quantity(document.hover_limit, DURATION)}", at.get("hover_limit", "")
    yield f"time_limit: {quantity(document.time_limit, DURATION)}", at.get("time_limit", "")
    yield from world_lines(document)
    yield "vehicles:", at["vehicles"]
    for vehicle in document.vehicles.values():
        yield from vehicle_lines(vehicle)
    yield from input_lines(document)
    yield from flow_lines(document)
    yield from callback_lines(document)
    yield from fault_lines(document)
    if document.expect:
        yield "expect:", at["expect"]
        for text in document.expect:
            yield f"  - {quoted(text.text)}", text.span.at
    yield from _target(document)


def _target(document: Document) -> Iterator[YamlLine]:
    header = place(document.spans.get("targets"))
    is_written = document.target.span != document.spans["mission"]
    yield "targets:", header
    yield f"  {document.target.text}:", document.target.span.at if is_written else ""
    for name, vehicle in document.vehicles.items():
        driver = vehicle.driver
        is_implied = driver.span == document.target.span and not is_written
        came_from = "" if is_implied else origin(driver)
        named = [use for use in vehicle.sensors if use.estimator.text]
        is_plain = not named and vehicle.own_tracker is None
        if is_plain:
            yield f"    {name}: {{driver: {part(driver)}}}", came_from
            continue
        yield f"    {name}:", came_from
        yield f"      driver: {part(driver)}", came_from
        if vehicle.own_tracker is not None:
            tracker = vehicle.tracker
            is_implied = tracker.span == driver.span
            yield f"      tracker: {part(tracker)}", "" if is_implied else origin(tracker)
        if not named:
            continue
        yield "      sensors:", named[0].estimator.span.at
        for estimator in dict.fromkeys(use.estimator.text for use in named):
            yield from _sensors([use for use in named if use.estimator.text == estimator])


def _sensors(uses: list[SensorEntry]) -> Iterator[YamlLine]:
    """The sensors of one estimator, as a list where there are several."""
    first = uses[0]
    if len(uses) == 1:
        yield f"        {first.estimator.text}: {part(first.part)}", origin(first.part)
        return
    yield f"        {first.estimator.text}:", first.estimator.span.at
    for use in uses:
        yield f"          - {part(use.part)}", origin(use.part)


def world_lines(document: Document) -> Iterator[YamlLine]:
    """The fence, the points, the obstacles and the tags; nothing where there are none."""
    at = place(document.spans.get("world"))
    parts = (document.fence, document.points, document.obstacles, document.moving, document.tags)
    if not any(parts):
        return
    yield "world:", at
    if document.fence is not None:
        yield f"  fence: {{{_corners(document.fence)}}}", place(document.spans.get("fence"))
    if document.points:
        yield "  points:", at
        for name, point in document.points.items():
            # wherever it was named stand its coordinates now: the name is kept, as its use
            called = f"{document.point_spans[name].at}, {PREFIX}{name}"
            yield f"    {name}: {vector(point, LENGTH)}", called
    if document.obstacles or document.moving:
        yield "  obstacles:", at
        for use in document.obstacles:
            contact = ", contact: allowed" if use.may_touch else ""
            yield f"    {use.name.text}: {{{_solid(use)}{contact}}}", use.span.at
    for moving in document.moving:
        fields = ", ".join(written_fields(moving.sphere, fields_of(MovingSphereParams)))
        text = f"{{moving_sphere: {{{fields}}}}}"
        yield f"    {moving.name.text}: {text}", moving.span.at
    if document.tags:
        yield "  tags:", at
        for tags in document.tags:
            yield f"    {tags.name.text}: {{{_tags(tags.params)}}}", tags.span.at


def _tags(params: Any) -> str:
    declaration: Any = type(params)
    fields = ", ".join(written_fields(params, fields_of(declaration)))
    match params:
        case GridParams():
            return f"grid: {{{fields}}}"
        case TagParams():
            return f"tag: {{{fields}}}"
        case _:
            return fields


def _corners(box: Box) -> str:
    return f"from: {vector(box.low, LENGTH)}, to: {vector(box.high, LENGTH)}"


def _solid(use: ObstacleEntry) -> str:
    if use.scan is not None:
        declaration: Any = type(use.scan.params)
        fields = ", ".join(written_fields(use.scan.params, fields_of(declaration)))
        return f"{use.scan.kind}: {{{fields}}}"
    shape = use.shape
    assert not isinstance(shape, Scanned)
    at = "" if isinstance(shape, Box) else f"at: {vector(shape.at, LENGTH)}"
    match shape:
        case Box():
            return f"box: {{{_corners(shape)}}}"
        case Cylinder(_, radius, height):
            size = f"radius: {quantity(radius, LENGTH)}, height: {quantity(height, LENGTH)}"
            return f"cylinder: {{{at}, {size}}}"
        case Sphere(_, radius):
            return f"sphere: {{{at}, radius: {quantity(radius, LENGTH)}}}"
        case Plane(_, facing):
            return f"plane: {{{at}, facing: {vector(facing, NUMBER)}}}"


def input_lines(document: Document) -> Iterator[YamlLine]:
    """`inputs:` with each on a line, as they are on the target; nothing where there is none."""
    if document.inputs:
        yield "inputs:", place(document.spans.get("inputs"))
    for use in document.inputs.values():
        more = [f"silent_after: {quantity(use.silent_after, DURATION)}"]
        if use.stuck_after is not None:
            more.append(f"stuck_after: {quantity(use.stuck_after, DURATION)}")
        if use.dead_man is not None:
            more.append(f"dead_man: {use.dead_man.text}")
        if use.renamed:
            names = ", ".join(f"{name.text}: {device.text}" for name, device in use.renamed)
            more.append(f"buttons: {{{names}}}")
        yield f"  {use.name.text}: {part(use.part, more=tuple(more))}", origin(use.part)


def flow_lines(document: Document) -> Iterator[YamlLine]:
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


def _flow(flow: FlowEntry) -> Iterator[YamlLine]:
    yield f"  {flow.name.text}:", flow.span.at
    yield f"    begin: {flow.begin.text}", flow.begin.span.at
    if flow.transitions:
        ways = ", ".join(map(way, flow.transitions))
        yield f"    next: [{ways}]", flow.transitions[0].span.at
    yield "    phases:", flow.span.at
    for phase in flow.phases.values():
        yield f"      {phase.name.text}: {_phase(phase)}", phase.span.at


def _phase(phase: PhaseEntry) -> str:
    options = [f"{a.target.text}: {option_value(a.value)}" for a in phase.set if a.target]
    pairs = [_pairs("give", phase.give), _pairs("run", phase.run, phase.values)]
    pairs.insert(1, f"set: {{{', '.join(options)}}}" if options else "")
    pairs.append("" if phase.arrive is None else f"arrive: {phase.arrive.text}")
    own = [transition for transition in phase.transitions if not transition.since]
    ways = [way(transition) for transition in own if transition.cause == "next"]
    pairs.append(f"next: [{', '.join(ways)}]" if ways else "")
    for transition in own:
        if transition.cause == "within" and transition.after is not None:
            limit = quantity(transition.after, DURATION)
            pairs.append(f"within: {limit}, otherwise: {quoted(transition.target.text)}")
    return "{" + ", ".join(pair for pair in pairs if pair) + "}"


def _pairs(
    key: str, pairs: tuple[tuple[Text, Text], ...], values: MappingOf[str, Mapping] | None = None
) -> str:
    goals = ((who.text, _goal(goal, (values or {}).get(who.text))) for who, goal in pairs)
    inside = ", ".join(f"{who}: {goal}" for who, goal in goals)
    return f"{key}: {{{inside}}}" if pairs else ""


def _goal(state: Text, values: Mapping | None) -> str:
    """A state, with the values that it is entered with."""
    name = quoted(state.text)
    return name if values is None else f"{{{name}: {option_value(values)}}}"


def callback_lines(document: Document) -> Iterator[YamlLine]:
    """`on:` with each callback on a line; nothing where there is none."""
    if document.callbacks:
        yield "on:", place(document.spans.get("on"))
    for callback in document.callbacks:
        yield f"  - {_callback_text(callback)}", callback.span.at


def _callback_text(callback: CallbackEntry) -> str:
    pairs = [] if callback.event is None else [f"event: {quoted(callback.event.text)}"]
    pairs += [f"{field.text}: {quoted(value.text)}" for field, value in callback.fields]
    if callback.when is not None:
        pairs.append(f"when: {quoted(callback.when.text)}")
    if callback.hold:
        pairs.append(f"for: {quantity(callback.hold, DURATION)}")
    actions = ", ".join(_action_text(action) for action in callback.actions)
    return "{" + ", ".join((*pairs, f"do: [{actions}]")) + "}"


def _action_text(action: ActionEntry) -> str:
    if action.part is not None:
        return f"{{{action.name.text}: {{{', '.join(parameters(action.part))}}}}}"
    name, value = action.name.text, action.value
    said = option_value(value) if name == "set" else _goal(value, action.values)
    if action.target is not None:
        said = f"{{{action.target.text}: {said}}}"
    return f"{{{action.name.text}: {said}}}"


def option_value(node: Node) -> str:
    """A parameter's value as it was written."""
    if isinstance(node, Mapping):
        inside = (f"{key}: {option_value(entry.value)}" for key, entry in node.entries.items())
        return "{" + ", ".join(inside) + "}"
    if isinstance(node, Sequence):
        return "[" + ", ".join(option_value(item) for item in node.items) + "]"
    return quoted(node.text) if isinstance(node, Scalar) else ""


def fault_lines(document: Document) -> Iterator[YamlLine]:
    """`faults:` with each on a line; nothing where there is none."""
    if document.faults:
        yield "faults:", place(document.spans.get("faults"))
    for fault in document.faults:
        values = origin(fault.part).removeprefix(fault.part.span.at)
        yield f"  - {_fault(fault)}", fault.span.at + values


def _fault(fault: FaultEntry) -> str:
    pairs = [f"on: {fault.vehicle.text}", f"inject: {fault.part.spec.name}"]
    if fault.time is not None:
        pairs.insert(0, f"at: {quantity(fault.time, DURATION)}")
    if fault.when is not None:
        pairs.insert(0, f"when: {quoted(fault.when.text)}")
    if fault.duration is not None:
        pairs.append(f"for: {quantity(fault.duration, DURATION)}")
    return "{" + ", ".join((*pairs, *parameters(fault.part))) + "}"
