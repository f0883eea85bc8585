"""`kybflow show`: a mission in a few lines, or whole after imports, parameters and defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from kybflow.api.findings import Answer, answer
from kybflow.cli.printing.mission_sections import sections
from kybflow.core.params import fields_of
from kybflow.core.units import LENGTH, MASS, format_quantity
from kybflow.dsl.document import Parameter
from kybflow.dsl.graph.drawing import cause_of
from kybflow.dsl.plan import PartPlan, Plan, StatePlan, VehiclePlan
from kybflow.dsl.reading.values import shown_value
from kybflow.dsl.resolving.parameters import shown_parameter


def show_mission(path: Path, resolved: bool, target: str | None, sets: tuple[str, ...]) -> Answer:
    """The mission in `path` in a few lines, or all of it with the origin of each line."""
    if resolved:
        return answer(path, target, sets, lambda plan, _: plan.resolved.rstrip())
    return answer(path, target, sets, lambda p, found: "\n".join(_summary(p, found.parameters)))


def _summary(plan: Plan, parameters: Mapping[str, Parameter]) -> Iterator[str]:
    yield f"{plan.mission}, on {plan.target}"
    if plan.summary:
        yield plan.summary
    if parameters:
        yield ""
        yield "parameters (change one with `--set NAME=VALUE`)"
    width = max(map(len, parameters), default=0)
    for name, parameter in parameters.items():
        yield f"  {name:<{width}}  {shown_parameter(parameter)}"
    for vehicle in plan.vehicles:
        yield ""
        yield from _vehicle(vehicle)
    for heading, lines in sections(plan):
        yield ""
        yield heading
        yield from (f"  {line}" for line in lines)


def _sensors(vehicle: VehiclePlan) -> Iterator[str]:
    """Each sensor; of several of one kind also the name."""
    kinds = [sensor.part.name for sensor in vehicle.sensors]
    for sensor, kind in zip(vehicle.sensors, kinds, strict=True):
        own = sensor.part.label.partition(".")[2]
        yield f"{kind} ({own})" if kinds.count(kind) > 1 else kind


def _vehicle(vehicle: VehiclePlan) -> Iterator[str]:
    mass = format_quantity(vehicle.airframe.mass, MASS)
    size = format_quantity(vehicle.airframe.diameter, LENGTH)
    yield f"{vehicle.name} ({mass}, {size} across)"
    yield f"  trusts     {', '.join(e.part.name for e in vehicle.estimators) or 'nothing'}"
    if vehicle.sensors:
        yield f"  senses by  {', '.join(_sensors(vehicle))}"
    yield f"  processed  {', '.join(p.name for p in vehicle.processors) or 'by nothing'}"
    yield f"  tracked    by {vehicle.tracker.name}, flown by {vehicle.driver.name}"
    yield f"  watched    {', '.join(s.name for s in vehicle.supervisors)}"
    for part in (*vehicle.processors, *vehicle.supervisors):
        yield from (f"  loosened   {line}" for line in _loosened(part))
    own = [state for state in vehicle.states.values() if not state.built_in]
    width = max(len(state.name) for state in own)
    for state in own:
        yield f"  {state.name:<{width}}  {state.behavior.name}{_ways(state)}"


def _loosened(part: PartPlan) -> Iterator[str]:
    """Each safety parameter of a part that is less strict than its default."""
    declaration: Any = type(part.params)
    for field in fields_of(declaration):
        own = getattr(part.params, field.name)
        if not field.required and field.loosens(field.default, own):
            before, after = shown_value(field.default, field), shown_value(own, field)
            yield f"{part.label}.{field.name} from {before} to {after} ({part.at})"


def _ways(state: StatePlan) -> str:
    """Its arrows, those that the language adds left out."""
    ways = [f"{cause_of(a)}: {a.target}" for a in state.transitions if not a.implied]
    return f" ({'; '.join(ways)})" if ways else ""
