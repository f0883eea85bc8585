"""The document to the plan: expressions parsed, built-in states and implied transitions added, the
files that parameters name recorded, spans reduced to `file:line`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kybflow.core.files import File
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import (
    Document,
    FaultEntry,
    InputEntry,
    PartUse,
    SensorEntry,
    StateEntry,
    TransitionEntry,
    VehicleEntry,
)
from kybflow.dsl.expressions import Expression, Scope, parse
from kybflow.dsl.lowering.callbacks import callback_plans
from kybflow.dsl.lowering.flows import flow_plans
from kybflow.dsl.names.built_in import BUILT_IN, end_of, failure_of
from kybflow.dsl.names.scopes import Scopes
from kybflow.dsl.plan import (
    EstimatorPlan,
    ExpectationPlan,
    FaultPlan,
    InputPlan,
    PartPlan,
    Plan,
    SensorPlan,
    SourceFile,
    StatePlan,
    TransitionPlan,
    VehiclePlan,
)
from kybflow.dsl.schema.world import TagFile
from kybflow.world.cameras import Camera
from kybflow.world.tags import TagMap

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


def lower(
    document: Document,
    catalog: Catalog,
    sources: tuple[SourceFile, ...],
    resolved: str,
) -> Plan:
    """The plan of a document that has no errors."""
    scopes = Scopes(document)
    drivers = [v.driver.spec.cls for v in document.vehicles.values()]
    built_in = _built_in(document.hover_limit, catalog)
    return Plan(
        mission=document.mission.text,
        summary=document.summary,
        target=document.target.text,
        simulated=all(cls.simulated for cls in drivers),
        control_rate=document.control_rate,
        hover_limit=document.hover_limit,
        time_limit=document.time_limit,
        fence=document.fence,
        vehicles=tuple(
            _vehicle(v, scopes, built_in, document.hover_limit) for v in document.vehicles.values()
        ),
        expectations=tuple(
            ExpectationPlan(text.as_written, _parsed(text, scopes.expectation()), text.span.at)
            for text in document.expect
        ),
        sources=(*sources, *attachments_of(document)),
        resolved=resolved,
        obstacles={use.name.text: use.shape for use in document.obstacles},
        moving={use.name.text: use.sphere for use in document.moving},
        watching=dict(_watching(document)),
        touchable=frozenset(use.name.text for use in document.obstacles if use.may_touch),
        points=document.points,
        tags=TagMap(tag for use in document.tags for tag in use.tags),
        groups={name: tuple(m.text for m in of) for name, of in document.groups.items()},
        flows=flow_plans(document, scopes.flow(), catalog),
        callbacks=callback_plans(document, scopes.flow(), catalog),
        faults=tuple(_fault(use, scopes) for use in document.faults),
        inputs=tuple(_input(use) for use in document.inputs.values()),
        files=files_of(document),
    )


def _watching(document: Document) -> Iterator[tuple[str, tuple[str, PartPlan]]]:
    """The first sensor that can tell where a moving obstacle is, and its vehicle."""
    for moving in document.moving:
        sensor = moving.tracked_by(document.vehicles.values())
        if sensor is not None:
            vehicle, use, params = sensor
            part = replace(_part(use, f"obstacles.{moving.name.text}"), params=params)
            yield moving.name.text, (vehicle.name.text, part)


def _input(use: InputEntry) -> InputPlan:
    name = use.name.text
    return InputPlan(
        name,
        _part(use.part, f"inputs.{name}"),
        use.buttons,
        use.silent_after,
        use.stuck_after,
        None if use.dead_man is None else use.dead_man.text,
        use.part.span.at,
    )


def _fault(use: FaultEntry, scopes: Scopes) -> FaultPlan:
    vehicle = use.vehicle.text
    when = None if use.when is None else _parsed(use.when, scopes.condition(vehicle))
    part = _part(use.part, use.part.label)
    return FaultPlan(part, vehicle, use.time, when, use.duration, use.span.at)


def _parsed(text: Text, scope: Scope) -> Expression:
    expression, found = parse(text, scope)
    if expression is None:
        raise ValueError(f"{text.text!r} passed the checks: {found}")
    return expression


def _vehicle(
    vehicle: VehicleEntry, scopes: Scopes, built_in: dict[str, StatePlan], hover_limit: float
) -> VehiclePlan:
    name = vehicle.name.text
    own = {n: _state(s, name, scopes) for n, s in vehicle.states.items()}
    return VehiclePlan(
        name=name,
        airframe=vehicle.airframe,
        start=vehicle.start,
        heading=vehicle.heading,
        estimators=tuple(
            EstimatorPlan(
                _part(e.part, f"estimators.{e.part.label}"),
                None if e.healthy is None else _parsed(e.healthy, scopes.health(name)),
                e.recover_after,
                e.for_at_most,
            )
            for e in vehicle.estimators
        ),
        processors=tuple(_part(p, f"processors.{p.label}") for p in vehicle.processors),
        tracker=_part(vehicle.tracker, "tracker"),
        supervisors=tuple(_part(s, f"supervisors.{s.label}") for s in vehicle.supervisors),
        driver=_part(vehicle.driver, "driver"),
        begin=vehicle.begin.text,
        states={**own, **built_in},
        at=vehicle.span.at,
        home=vehicle.home,
        hover_limit=hover_limit,
        cameras=_cameras(vehicle),
        sensors=tuple(_sensors(vehicle)),
        payload=vehicle.payload,
    )


def _cameras(vehicle: VehicleEntry) -> dict[str, Camera]:
    """The airframe's, as the sensors on this target have them."""
    cameras: Mapping[str, Camera] = {use.name.text: use.camera for use in vehicle.cameras}
    for use in vehicle.sensors:
        cameras = use.part.spec.cls.seen_by(use.part.params, cameras)
    return dict(cameras)


def _sensors(vehicle: VehicleEntry) -> Iterator[SensorPlan]:
    """Each sensor once, however many estimators it is named for."""
    named: dict[tuple[str, Any], tuple[SensorEntry, list[str]]] = {}
    for use in vehicle.sensors:
        _, names = named.setdefault((use.part.spec.name, use.part.params), (use, []))
        names += [use.estimator.text] if use.estimator.text else []
    for first, names in named.values():
        yield SensorPlan(_part(first.part, f"sensors.{first.label}"), tuple(names))


def _part(use: PartUse, label: str) -> PartPlan:
    return PartPlan(use.spec.name, use.spec.cls, use.params, label, use.span.at)


def _state(state: StateEntry, vehicle: str, scopes: Scopes) -> StatePlan:
    legs = state.part.spec.cls.flight
    transitions = [_transition(t, vehicle, scopes) for t in state.transitions]
    causes = {transition.cause for transition in transitions}
    at = state.span.at
    if "then" not in causes:
        transitions.append(TransitionPlan("then", end_of(legs), implied=True, at=at))
    if "failed" not in causes:
        transitions.append(TransitionPlan("failed", failure_of(legs), implied=True, at=at))
    order = ("next", "then", "failed", "within")
    transitions.sort(key=lambda transition: order.index(transition.cause))
    name = state.name.text
    estimators = tuple(text.text for text in state.estimators)
    behavior = _part(state.part, _label(name))
    return StatePlan(name, behavior, legs, tuple(transitions), at=at, estimators=estimators)


def _label(state: str) -> str:
    """The name of a state's behavior in options."""
    return f"behaviors.{state}"


def _transition(transition: TransitionEntry, vehicle: str, scopes: Scopes) -> TransitionPlan:
    when = transition.when
    return TransitionPlan(
        cause=transition.cause,
        target=transition.target.text,
        when=None if when is None else _parsed(when, scopes.condition(vehicle)),
        event=None if transition.event is None else transition.event.text,
        after=transition.after,
        hold=transition.hold,
        at=transition.span.at,
        emit=None if transition.emit is None else transition.emit.text,
        since=transition.since,
        enters=transition.enters,
    )


def _built_in(hover_limit: float, catalog: Catalog) -> dict[str, StatePlan]:
    transitions = {
        "brake": (_implied("then", "hover"), _implied("failed", "hover")),
        "hover": (
            TransitionPlan("next", "auto_land", after=hover_limit, implied=True),
            _implied("then", "auto_land"),
            _implied("failed", "auto_land"),
        ),
        "auto_home": (_implied("then", "auto_land"), _implied("failed", "auto_land")),
        "auto_land": (_implied("then", "landed"), _implied("failed", "land_blind")),
        "land_blind": (_implied("then", "fault"), _implied("failed", "fault")),
    }
    states = {}
    for name, part in BUILT_IN.items():
        spec = catalog.get("behaviors", part)
        behavior = PartPlan(part, spec.cls, spec.params(), _label(name))
        states[name] = StatePlan(name, behavior, spec.cls.flight, transitions.get(name, ()), True)
    return states


def _implied(cause: str, target: str) -> TransitionPlan:
    return TransitionPlan(cause, target, implied=True)  # type: ignore[arg-type]


def attachments_of(document: Document) -> tuple[SourceFile, ...]:
    """Every file that a parameter of the mission names, once."""
    found: dict[str, SourceFile] = {}
    for file, beside in _named(document):
        path = os.path.normpath(os.path.join(beside, file.name))
        found[path] = SourceFile(path, file.sha256)
    return tuple(found.values())


def files_of(document: Document) -> tuple[File, ...]:
    """The content of every file that a parameter of the mission names, once for each name."""
    return tuple(dict.fromkeys(file for file, _ in _named(document)))


def _named(document: Document) -> Iterator[tuple[File, str]]:
    """Each file that a parameter names, and the folder beside which it does."""
    yield from _named_by_parts(document)
    for tags in document.tags:
        if isinstance(tags.params, TagFile):
            yield tags.params.file, os.path.dirname(tags.span.file)
    for obstacle in document.obstacles:
        if obstacle.scan is not None:
            beside = os.path.dirname(obstacle.scan.span.file)
            yield from ((file, beside) for file in obstacle.scan.files)
    for vehicle in document.vehicles.values():
        for camera in vehicle.cameras:
            if camera.params.calibration is not None:
                beside = os.path.dirname(camera.spans["calibration"].file)
                yield camera.params.calibration, beside


def _named_by_parts(document: Document) -> Iterator[tuple[File, str]]:
    for use in _uses(document):
        for field in use.spec.fields:
            file = getattr(use.params, field.name)
            if isinstance(file, File):
                yield file, os.path.dirname(use.spans[field.name].file)


def _uses(document: Document) -> Iterator[PartUse]:
    for vehicle in document.vehicles.values():
        yield from (s.part for s in vehicle.sensors)
        yield from (e.part for e in vehicle.estimators)
        yield from (*vehicle.processors, vehicle.tracker, *vehicle.supervisors, vehicle.driver)
        yield from (state.part for state in vehicle.states.values())
    yield from (use.part for use in document.inputs.values())
