"""What `kybflow show` prints: a mission in a few lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from kybflow.core.geometry import Vec3
from kybflow.core.params import fields_of
from kybflow.core.units import DURATION, LENGTH, MASS, format_quantity
from kybflow.dsl.expressions import describe
from kybflow.dsl.expressions.describe import quantity
from kybflow.dsl.graph.drawing import cause_of
from kybflow.dsl.plan import (
    ActionPlan,
    Call,
    CallbackPlan,
    Emit,
    Enable,
    EnterPhase,
    FaultPlan,
    FlowPlan,
    InputPlan,
    LogText,
    Parameter,
    PartPlan,
    Perform,
    PhasePlan,
    Plan,
    SetOption,
    StatePlan,
    Switch,
    Values,
    VehiclePlan,
)
from kybflow.dsl.reading.values import shown_value
from kybflow.dsl.resolving.parameters import shown_parameter
from kybflow.flight.loops.design import margins_of
from kybflow.flight.loops.margins import in_words


def show_mission(plan: Plan, parameters: Mapping[str, Parameter]) -> str:
    """A mission in a few lines: its parameters, its vehicles with their states, then the rest."""
    return "\n".join(_lines(plan, parameters))


def _lines(plan: Plan, parameters: Mapping[str, Parameter]) -> Iterator[str]:
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
        yield from _vehicle(vehicle, 1.0 / plan.control_rate)
    for heading, lines in _sections(plan):
        yield ""
        yield heading
        yield from (f"  {line}" for line in lines)


def _sensors(vehicle: VehiclePlan) -> Iterator[str]:
    """Each sensor, with its name where the vehicle has several of its kind."""
    kinds = [sensor.part.name for sensor in vehicle.sensors]
    for sensor, kind in zip(vehicle.sensors, kinds, strict=True):
        own = sensor.part.label.partition(".")[2]
        yield f"{kind} ({own})" if kinds.count(kind) > 1 else kind


def _vehicle(vehicle: VehiclePlan, period: float) -> Iterator[str]:
    mass = format_quantity(vehicle.airframe.mass, MASS)
    size = format_quantity(vehicle.airframe.diameter, LENGTH)
    yield f"{vehicle.name} ({mass}, {size} across)"
    yield f"  trusts     {', '.join(e.part.name for e in vehicle.estimators) or 'nothing'}"
    if vehicle.sensors:
        yield f"  senses by  {', '.join(_sensors(vehicle))}"
    yield f"  processed  {', '.join(p.name for p in vehicle.processors) or 'by nothing'}"
    yield f"  tracked    by {vehicle.tracker.name}, flown by {vehicle.driver.name}"
    yield from _loop(vehicle, period)
    yield f"  watched    {', '.join(s.name for s in vehicle.supervisors)}"
    for part in (*vehicle.processors, *vehicle.supervisors):
        yield from (f"  loosened   {line}" for line in _loosened(part))
    own = [state for state in vehicle.states.values() if not state.built_in]
    width = max(len(state.name) for state in own)
    for state in own:
        yield f"  {state.name:<{width}}  {state.behavior.name}{_ways(state)}"


def _loop(vehicle: VehiclePlan, period: float) -> Iterator[str]:
    """The gains of the position loop and the margins that they leave, where they are known."""
    driver, tracker, airframe = vehicle.driver, vehicle.tracker, vehicle.airframe
    inner = driver.cls.inner_loop(driver.params, airframe)
    outer = tracker.cls.outer_loop(tracker.params, airframe, inner, period)
    if outer is None:
        return
    k, d, i = outer.proportional, outer.derivative, outer.integral
    yield f"  gains      proportional {k:.3g}, derivative {d:.3g}, integral {i:.3g}"
    if inner is not None:
        yield f"  margins    {in_words(margins_of(outer, inner)).replace(' margin', '')}"


def _loosened(part: PartPlan) -> Iterator[str]:
    """Each safety parameter of a part that is less strict than its default."""
    declaration: Any = type(part.params)
    for field in fields_of(declaration):
        own = getattr(part.params, field.name)
        if not field.required and field.loosens(field.default, own):
            before, after = shown_value(field.default, field), shown_value(own, field)
            yield f"{part.label}.{field.name} from {before} to {after} ({part.at})"


def _ways(state: StatePlan) -> str:
    """The transitions of a state, without those that the language adds."""
    ways = [f"{cause_of(a)}: {a.target}" for a in state.transitions if not a.implied]
    return f" ({'; '.join(ways)})" if ways else ""


def _sections(plan: Plan) -> Iterator[tuple[str, list[str]]]:
    """The heading and lines of each section that the mission has beside its vehicles."""
    every = [
        ("world", list(_world(plan))),
        ("inputs", [_input(own) for own in plan.inputs]),
        ("groups", [f"{name}: {', '.join(of)}" for name, of in plan.groups.items()]),
        *((_flow_heading(flow), _flow(flow, plan.groups)) for flow in plan.flows),
        ("callbacks", [_callback(callback) for callback in plan.callbacks]),
        ("faults", [_fault(fault) for fault in plan.faults]),
        ("expected", [expectation.text for expectation in plan.expectations]),
    ]
    return ((heading, lines) for heading, lines in every if lines)


def _world(plan: Plan) -> Iterator[str]:
    if plan.fence is not None:
        yield f"fence from {_point(plan.fence.low)} to {_point(plan.fence.high)}"
    for name, shape in plan.obstacles.items():
        yield f"obstacle {name} ({type(shape).__name__.lower()})"
    for name, point in plan.points.items():
        yield f"point {name} at {_point(point)}"
    for family in plan.tags.families:
        sizes = sorted({tag.size for tag in plan.tags if tag.family == family})
        count = sum(tag.family == family for tag in plan.tags)
        across = ", ".join(f"{size * 100:.4g} cm" for size in sizes)
        yield f"{count} tag{'s' if count > 1 else ''} of {family} ({across})"


def _point(point: Vec3) -> str:
    return f"[{', '.join(f'{value:.4g}' for value in point)}] m"


def _input(own: InputPlan) -> str:
    """`stick: gamepad (a is take; dead man: right_shoulder)`."""
    renamed = [f"{button} is {name}" for button, name in own.buttons.items() if button != name]
    held = [] if own.dead_man is None else [f"dead man: {own.dead_man}"]
    known = "; ".join((*renamed, *held))
    return f"{own.name}: {own.part.name}" + (f" ({known})" if known else "")


def _flow_heading(flow: FlowPlan) -> str:
    drives = ", ".join(flow.vehicles) or "what it is given"
    return f"flow {flow.name} (drives {drives}; begins with {flow.begin})"


def _flow(flow: FlowPlan, groups: dict[str, tuple[str, ...]]) -> list[str]:
    width = max(map(len, flow.phases))
    return [f"{name:<{width}}  {_phase(phase, groups)}" for name, phase in flow.phases.items()]


def _phase(phase: PhasePlan, groups: dict[str, tuple[str, ...]]) -> str:
    """The states, options and vehicles that a phase sets, and its transitions."""
    states: dict[str, list[str]] = {}
    for vehicle, request in phase.run.items():
        goal = _goal(request.chain or request.state, request.values)
        states.setdefault(goal, []).append(vehicle)
    names = {of: name for name, of in groups.items()}
    steps = [f"{names.get(tuple(v), ', '.join(v))}: {state}" for state, v in states.items()]
    steps += [f"arrive {phase.arrive}"] if phase.arrive else []
    steps += [f"give {vehicle} to {flow}" for vehicle, flow in phase.give.items()]
    steps += [_action(option) for option in phase.options]
    ways = "; ".join(f"{cause_of(way)}: {way.target}" for way in phase.transitions)
    return "; ".join(steps) + (f" ({ways})" if ways else "")


def _goal(state: str, values: Values) -> str:
    """A state, and the values (SI) that it is entered with."""
    shown = ", ".join(f"{name} {_number(value)}" for name, value in values)
    return f"{state} with {shown}" if shown else state


def _number(value: Any) -> str:
    """A value (SI) without the digits that nobody reads."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_number, value))}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _callback(callback: CallbackPlan) -> str:
    """`d.battery_low, when elapsed > 3 s: stop`."""
    whose = ", ".join(filter(None, callback.vehicles))
    words = [f"{whose}.{callback.event}" if whose else callback.event] if callback.event else []
    words += [f"{name} {value}" for name, value in callback.fields]
    if callback.when is not None:
        lasts = f" for {format_quantity(callback.hold, DURATION)}" if callback.hold else ""
        words.append(f"when {describe(callback.when)}{lasts}")
    return f"{', '.join(words)}: {'; '.join(map(_action, callback.actions))}"


def _action(action: ActionPlan) -> str:
    match action:
        case Switch() | Enable() | Perform():
            return _asked(action)
        case SetOption(option, value):
            return f"set {option} to {_number(value)}"
        case Emit(name):
            return f"emit {name}"
        case EnterPhase(flow, phase):
            return f"enter {phase} of {flow}"
        case LogText(text):
            return f"log `{text}`"
        case Call(part):
            return f"call {part.name}"
        case _:
            return f"stop: {action.reason}"


def _asked(action: Switch | Enable | Perform) -> str:
    """What a vehicle is asked for."""
    match action:
        case Switch(vehicle, state, values):
            return f"switch {vehicle} to {_goal(state, values)}"
        case Enable(vehicle, label, on):
            return f"{'enable' if on else 'disable'} {label} of {vehicle}"
        case Perform(vehicle, act):
            return f"let {vehicle} perform {act}"


def _fault(fault: FaultPlan) -> str:
    """`wind on mk, when behavior == square, for 3 s`."""
    words = [f"{fault.part.name} on {fault.vehicle}"]
    if fault.time is not None:
        words.append(f"at {quantity(fault.time, DURATION)}")
    if fault.when is not None:
        words.append(f"when {describe(fault.when)}")
    if fault.duration is not None:
        words.append(f"for {quantity(fault.duration, DURATION)}")
    return ", ".join(words)
