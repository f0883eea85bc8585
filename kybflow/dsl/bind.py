"""Turns the plan as written into the plan that the runtime executes: parses conditions, replaces
groups by their vehicles, adds built-in states and implied transitions, and records files. Only a
plan without errors is bound, so nothing is reported here."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from kybflow.core.files import File
from kybflow.dsl.diagnostics import Collector, Text
from kybflow.dsl.expanding.flows import given_vehicles, own_vehicles, values_for
from kybflow.dsl.expressions import Expression, Scope, parse
from kybflow.dsl.expressions.tree import Unparsed
from kybflow.dsl.language.records import Record
from kybflow.dsl.names import (
    AUTO_HOME,
    AUTO_LAND,
    BRAKE,
    BUILT_IN,
    FAULT,
    HOVER,
    LAND_BLIND,
    LANDED,
    Scopes,
    end_of,
    failure_of,
    option_values,
)
from kybflow.dsl.plan import (
    ActionKeys,
    ActionPlan,
    Call,
    CallbackPlan,
    Emit,
    Enable,
    EnterPhase,
    ExpectationPlan,
    LogText,
    PartPlan,
    Perform,
    PhasePlan,
    Plan,
    Request,
    SensorPlan,
    SetOption,
    SourceFile,
    StatePlan,
    Stop,
    Switch,
    TransitionPlan,
    VehiclePlan,
)
from kybflow.world.cameras import Camera
from kybflow.world.tags import TagMap

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

_ORDER = ("next", "then", "failed", "within")
_TEXTS: dict[str, type[Emit | LogText | Stop]] = {"emit": Emit, "log": LogText, "stop": Stop}


def bind(plan: Plan, catalog: Catalog, sources: tuple[SourceFile, ...], resolved: str) -> Plan:
    """Return the plan in the form that the runtime executes.

    sources: the YAML files of the mission. resolved: the resolved mission as YAML text.
    """
    scopes = Scopes(plan)
    built_in = _built_in(plan.hover_limit, catalog)
    return plan.but(
        vehicles=tuple(_vehicle(v, scopes, built_in, plan.hover_limit) for v in plan.vehicles),
        expectations=tuple(
            ExpectationPlan(text.as_written, _parsed(text, scopes.expectation()), text.span.at)
            for text in plan.texts_of("expect")
        ),
        sources=(*sources, *attachments_of(plan)),
        part_files=tuple(SourceFile(str(file), digest) for file, digest in catalog.files),
        resolved=resolved,
        watching={
            name: (seen[0].name, seen[1].but(params=seen[2], label=f"tracked.{name}"))
            for name in plan.tracked
            if (seen := plan.tracked_by(name)) is not None
        },
        tags=TagMap(tag for entry in plan.world.tags for tag in entry.tags),
        flows=tuple(
            flow.but(
                vehicles=(own := own_vehicles(plan, flow)),
                phases={n: _phase(p, plan, scopes.flow(), catalog) for n, p in flow.phases.items()},
                waits=not own and bool(given_vehicles(plan, flow)),
            )
            for flow in plan.flows
        ),
        callbacks=tuple(_callback(one, plan, scopes.flow(), catalog) for one in plan.callbacks),
        faults=tuple(
            fault.but(when=_when(fault.when, scopes.condition(fault.vehicle)))
            for fault in plan.faults
        ),
        inputs=tuple(use.but(part=use.part.but(label=f"inputs.{use.name}")) for use in plan.inputs),
        files=tuple(dict.fromkeys(file for file, _ in _named(plan))),
    )


def _parsed(text: Text, scope: Scope) -> Expression:
    expression, found = parse(text, scope)
    if expression is None:
        raise ValueError(f"{text.text!r} passed the checks: {found}")
    return expression


def _when(condition: Any, scope: Scope) -> Expression | None:
    return _parsed(condition.text, scope) if isinstance(condition, Unparsed) else condition


def _vehicle(
    vehicle: VehiclePlan, scopes: Scopes, built_in: dict[str, StatePlan], hover_limit: float
) -> VehiclePlan:
    """Return the vehicle with the built-in states and the airframe's cameras, updated with what the
    sensors of this target know about them."""
    scope, health = scopes.condition(vehicle.name), scopes.health(vehicle.name)
    own = {name: _state(state, scope) for name, state in vehicle.states.items()}
    cameras: Mapping[str, Camera] = vehicle.own_cameras
    for use in vehicle.sensors:
        cameras = use.part.cls.seen_by(use.part.params, cameras)
    return vehicle.but(
        estimators=tuple(e.but(healthy=_when(e.healthy, health)) for e in vehicle.estimators),
        states={**own, **built_in},
        hover_limit=hover_limit,
        cameras=dict(cameras),
        sensors=tuple(_sensors(vehicle)),
    )


def _sensors(vehicle: VehiclePlan) -> Iterator[SensorPlan]:
    """Yield each sensor once, with all estimators that use it."""
    named: dict[tuple[str, Any], tuple[SensorPlan, list[str]]] = {}
    for use in vehicle.sensors:
        _, names = named.setdefault((use.part.name, use.part.params), (use, []))
        names += use.estimators
    for first, names in named.values():
        part = first.part.but(label=f"sensors.{first.label}")
        yield first.but(part=part, estimators=tuple(names))


def _state(state: StatePlan, scope: Scope) -> StatePlan:
    transitions = [t.but(when=_when(t.when, scope)) for t in state.transitions]
    causes = {transition.cause for transition in transitions}
    for cause, target in (("then", end_of(state.legs)), ("failed", failure_of(state.legs))):
        if cause not in causes:
            transitions.append(_implied(cause, target, state.at))
    transitions.sort(key=lambda transition: _ORDER.index(transition.cause))
    return state.but(transitions=tuple(transitions))


def _implied(cause: Any, target: str, at: str = "") -> TransitionPlan:
    return TransitionPlan(target=target, cause=cause, implied=True, at=at)


def _built_in(hover_limit: float, catalog: Catalog) -> dict[str, StatePlan]:
    late = TransitionPlan(target=AUTO_LAND, after=hover_limit, implied=True)
    ways = {
        BRAKE: (_implied("then", HOVER), _implied("failed", HOVER)),
        HOVER: (late, _implied("then", AUTO_LAND), _implied("failed", AUTO_LAND)),
        AUTO_HOME: (_implied("then", AUTO_LAND), _implied("failed", AUTO_LAND)),
        AUTO_LAND: (_implied("then", LANDED), _implied("failed", LAND_BLIND)),
        LAND_BLIND: (_implied("then", FAULT), _implied("failed", FAULT)),
    }
    states = {}
    for name, part in BUILT_IN.items():
        spec = catalog.get("behaviors", part)
        behavior = PartPlan(part, spec.cls, spec.params(), f"behaviors.{name}")
        states[name] = StatePlan(
            name=name, behavior=behavior, legs=spec.cls.flight, transitions=ways.get(name, ()),
            built_in=True,
        )  # fmt: skip
    return states


def _phase(phase: PhasePlan, plan: Plan, scope: Scope, catalog: Catalog) -> PhasePlan:
    return phase.but(
        run={
            name: _request(plan.fleet[name], request)
            for who, request in phase.run.items()
            for name in plan.members(who)
        },
        give={name: goal for who, goal in phase.give.items() for name in plan.members(who)},
        options=tuple(
            SetOption(option.name, value)
            for target in phase.pairs("set")
            for option, value in option_values(*target, plan, catalog, Collector())
        ),
        transitions=tuple(t.but(when=_when(t.when, scope)) for t in phase.transitions),
        ends=all(bool(transition.since) for transition in phase.transitions),
    )


def _request(vehicle: VehiclePlan, request: Request) -> Request:
    """Return a request with its state and values resolved for one vehicle."""
    state = vehicle.goal(request.state)
    chain = request.state if state != request.state else ""
    return request.but(state=state, values=values_for(vehicle, request), chain=chain)


def _callback(callback: CallbackPlan, plan: Plan, scope: Scope, catalog: Catalog) -> CallbackPlan:
    first, dot, name = callback.event.partition(".")
    vehicles = tuple(plan.fleet) if first == "any" else plan.members(first)
    if not dot or not vehicles:  # an event of the run, or no event
        name, vehicles = callback.event, ("",) if callback.event else ()
    actions = (own for action in callback.do for own in _actions(action, plan, catalog))
    when = _when(callback.when, scope)
    return callback.but(event=name, vehicles=vehicles, actions=tuple(actions), when=when)


def _actions(action: ActionKeys, plan: Plan, catalog: Catalog) -> Iterator[ActionPlan]:
    name, target, value = action.name, action.target, action.value
    if action.part is not None:
        yield Call(action.part)
    elif name == "switch" and target is not None:
        for vehicle in plan.members(target):
            request = _request(plan.fleet[vehicle], value)
            yield Switch(vehicle, request.state, request.values)
    elif name == "perform" and target is not None:
        yield from (Perform(vehicle, value) for vehicle in plan.members(target))
    elif name == "set":
        name_and_node = (action.target_text, action.value_node)
        for option, decoded in option_values(*name_and_node, plan, catalog, Collector()):
            yield SetOption(option.name, decoded)
    elif name in ("enable", "disable"):
        who, _, label = value.partition(".")
        yield from (Enable(vehicle, label, name == "enable") for vehicle in plan.members(who))
    elif name == "phase":
        flow = target or next(flow.name for flow in plan.flows if value in flow.phases)
        yield EnterPhase(flow, value)
    else:
        yield _TEXTS[name](value)


def attachments_of(plan: Plan) -> tuple[SourceFile, ...]:
    """Return every file that a parameter of the mission names, once."""
    found: dict[str, SourceFile] = {}
    for file, beside in _named(plan):
        path = os.path.normpath(os.path.join(beside, file.name))
        found[path] = SourceFile(path, file.sha256)
    return tuple(found.values())


def _named(plan: Plan) -> Iterator[tuple[File, str]]:
    """Yield each file that a parameter names, and the folder to which its path is relative."""
    parts: list[PartPlan] = []
    for vehicle in plan.vehicles:
        parts += (*(sensor.part for sensor in vehicle.sensors), *vehicle.parts, vehicle.driver)
    for use in (*parts, *(use.part for use in plan.inputs)):
        for field in use.fields:
            file = getattr(use.params, field.name)
            if isinstance(file, File):
                yield file, os.path.dirname(use.span_of(field.key).file)
    yield from (
        (tags.file, os.path.dirname(tags.span.file)) for tags in plan.world.tags if tags.file
    )
    for obstacle in plan.world.obstacles:
        scan: Record | None = obstacle.point_cloud or obstacle.occupancy
        beside = "" if scan is None else os.path.dirname(scan.span_of("file").file)
        yield from ((file, beside) for file in obstacle.files)
    for camera in (camera for vehicle in plan.vehicles for camera in vehicle.body.cameras):
        if camera.calibration is not None:
            yield camera.calibration, os.path.dirname(camera.span_of("calibration").file)
