"""The mission after everything, as YAML: no import, no `like`, no parameter, every default written,
and where each line came from. Reading it back gives the same plan."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.units import DURATION, FREQUENCY
from kybflow.dsl.document import Document, SensorUse
from kybflow.dsl.resolving.imports import without_homes
from kybflow.dsl.writing.callbacks import callback_lines
from kybflow.dsl.writing.faults import fault_lines
from kybflow.dsl.writing.flows import flow_lines
from kybflow.dsl.writing.values import Line, origin, part, place, quantity, quoted
from kybflow.dsl.writing.vehicle import vehicle_lines
from kybflow.dsl.writing.world import world_lines


def written(document: Document) -> str:
    """The text, each line with its origin as a comment."""
    lines = list(_mission(document))
    width = min(max(len(line) for line, _ in lines), 76)
    return "".join(
        f"{line:<{width}}  # {without_homes(came_from) or 'default'}\n" if line.strip() else "\n"
        for line, came_from in lines
    )


def _mission(document: Document) -> Iterator[Line]:
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
    yield from flow_lines(document)
    yield from callback_lines(document)
    yield from fault_lines(document)
    if document.expect:
        yield "expect:", at["expect"]
        for text in document.expect:
            yield f"  - {quoted(text.text)}", text.span.at
    yield from _target(document)


def _target(document: Document) -> Iterator[Line]:
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


def _sensors(uses: list[SensorUse]) -> Iterator[Line]:
    """Those of one estimator, as a list where they are several."""
    first = uses[0]
    if len(uses) == 1:
        yield f"        {first.estimator.text}: {part(first.part)}", origin(first.part)
        return
    yield f"        {first.estimator.text}:", first.estimator.span.at
    for use in uses:
        yield f"          - {part(use.part)}", origin(use.part)
