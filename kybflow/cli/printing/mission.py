"""The output of `kybflow show`: a summary of a mission."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from kybflow.cli.output import columns, grouped
from kybflow.core.geometry import Vec3
from kybflow.core.params import fields_of
from kybflow.core.units import DURATION, LENGTH, MASS, format_quantity
from kybflow.dsl import plan as plans
from kybflow.dsl.expressions import describe
from kybflow.dsl.expressions.tree import quantity
from kybflow.dsl.graph.drawing import cause_of
from kybflow.dsl.reading.values import shown_value
from kybflow.dsl.resolving.parameters import shown_parameter
from kybflow.flight.loops.margins import in_words
from kybflow.flight.loops.position_loop import margins_of


def show_mission(plan: plans.Plan, parameters: Mapping[str, plans.Parameter]) -> str:
    """Summarise a mission: its parameters, its vehicles with their states, then everything else."""
    lines = [f"{plan.mission}, on {plan.target}", *filter(None, [plan.summary])]
    if parameters:
        rows = [(name, shown_parameter(parameter)) for name, parameter in parameters.items()]
        lines += ["", "parameters (change one with `--set NAME=VALUE`)", *columns(rows, "  ")]
    for vehicle in plan.vehicles:
        lines += ["", *_vehicle(vehicle, 1.0 / plan.control_rate)]
    groups = [f"{name}: {', '.join(members)}" for name, members in plan.groups.items()]
    sections: list[tuple[str, Iterable[str]]] = [
        ("world", _world(plan)),
        ("inputs", map(_input, plan.inputs)),
        ("groups", groups),
        *(_flow(flow, plan.groups) for flow in plan.flows),
        ("callbacks", map(_callback, plan.callbacks)),
        ("faults", map(_fault, plan.faults)),
        ("expected", (expectation.text for expectation in plan.expectations)),
    ]
    for heading, found in sections:
        if within := [f"  {line}" for line in found]:
            lines += ["", heading, *within]
    return "\n".join(lines)


def _vehicle(vehicle: plans.VehiclePlan, period: float) -> Iterator[str]:
    mass = format_quantity(vehicle.airframe.mass, MASS)
    size = format_quantity(vehicle.airframe.diameter, LENGTH)
    yield f"{vehicle.name} ({mass}, {size} across)"
    yield f"  trusts     {', '.join(e.part.name for e in vehicle.estimators) or 'nothing'}"
    if sensors := [sensor.part for sensor in vehicle.sensors]:
        kinds = [part.name for part in sensors]
        labels = (part.label.partition(".")[2] for part in sensors)
        names = (
            f"{k} ({o})" if kinds.count(k) > 1 else k for k, o in zip(kinds, labels, strict=True)
        )
        yield f"  senses by  {', '.join(names)}"
    yield f"  processed  {', '.join(p.name for p in vehicle.processors) or 'by nothing'}"
    yield f"  tracked    by {vehicle.tracker.name}, flown by {vehicle.driver.name}"
    yield from _loop(vehicle, period)
    yield f"  watched    {', '.join(s.name for s in vehicle.supervisors)}"
    for part in (*vehicle.processors, *vehicle.supervisors):
        declaration: Any = type(part.params)
        for field in fields_of(declaration):
            own = getattr(part.params, field.name)
            if not field.required and field.loosens(field.default, own):
                before, after = shown_value(field.default, field), shown_value(own, field)
                name = f"{part.label}.{field.name}"
                yield f"  loosened   {name} from {before} to {after} ({part.at})"
    states = [state for state in vehicle.states.values() if not state.built_in]
    rows = [(s.name, s.behavior.name + _ways(s.transitions)) for s in states]
    yield from columns(rows, "  ")


def _loop(vehicle: plans.VehiclePlan, period: float) -> Iterator[str]:
    """Yield the gains and the stability margins of the position loop, if they are known."""
    driver, tracker, airframe = vehicle.driver, vehicle.tracker, vehicle.airframe
    inner = driver.cls.inner_loop(driver.params, airframe)
    outer = tracker.cls.outer_loop(tracker.params, airframe, inner, period)
    if outer is None:
        return
    d, i, matrix = outer.derivative, outer.integral, outer.stiffness
    all_of = (outer.proportional,) if matrix is None else (*matrix.level, *matrix.up)
    k = " to ".join(f"{gain:.3g}" for gain in sorted({min(all_of), max(all_of)}))
    yield f"  gains      proportional {k}, derivative {d:.3g}, integral {i:.3g}"
    if inner is not None:
        is_coupled = matrix is not None and matrix.is_coupled
        about = ", estimated: the height is coupled with x and y" if is_coupled else ""
        yield f"  margins    {in_words(margins_of(outer, inner)).replace(' margin', '')}{about}"


def _ways(transitions: Iterable[plans.TransitionPlan]) -> str:
    """Return the declared transitions in brackets; empty if there are none."""
    ways = "; ".join(f"{cause_of(way)}: {way.target}" for way in transitions if not way.implied)
    return f" ({ways})" if ways else ""


def _world(plan: plans.Plan) -> Iterator[str]:
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


def _input(own: plans.InputPlan) -> str:
    """Format an input, such as `stick: gamepad (a is take; dead man: right_shoulder)`."""
    renamed = [f"{button} is {name}" for button, name in own.button_names.items() if button != name]
    held = [] if own.dead_man is None else [f"dead man: {own.dead_man}"]
    known = "; ".join((*renamed, *held))
    return f"{own.name}: {own.part.name}" + (f" ({known})" if known else "")


def _flow(flow: plans.FlowPlan, groups: dict[str, tuple[str, ...]]) -> tuple[str, list[str]]:
    """Return the heading of a flow, and a line per phase: the states, options and vehicles that it
    sets, and its transitions."""
    rows, names = [], {of: name for name, of in groups.items()}
    for name, phase in flow.phases.items():
        states = grouped(
            (_goal(request.chain or request.state, request.values), vehicle)
            for vehicle, request in phase.run.items()
        )
        steps = [f"{names.get(tuple(v), ', '.join(v))}: {state}" for state, v in states.items()]
        steps += [f"arrive {phase.arrive}"] if phase.arrive else []
        steps += [f"give {vehicle} to {of}" for vehicle, of in phase.give.items()]
        steps += [_action(option) for option in phase.options]
        rows.append((name, "; ".join(steps) + _ways(phase.transitions)))
    drives = ", ".join(flow.vehicles) or "given vehicles"
    return f"flow {flow.name} (drives {drives}; begins with {flow.begin})", columns(rows)


def _goal(state: str, values: plans.Values) -> str:
    """Return a state with the values with which it is entered (SI)."""
    shown = ", ".join(f"{name} {_number(value)}" for name, value in values)
    return f"{state} with {shown}" if shown else state


def _number(value: Any) -> str:
    """Format a value (SI) with four significant digits."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_number, value))}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _callback(callback: plans.CallbackPlan) -> str:
    """Format a callback, such as `d.battery_low, when elapsed > 3 s: stop`."""
    whose = ", ".join(filter(None, callback.vehicles))
    words = [f"{whose}.{callback.event}" if whose else callback.event] if callback.event else []
    words += [f"{name} {value}" for name, value in callback.fields]
    if callback.when is not None:
        lasts = f" for {format_quantity(callback.hold, DURATION)}" if callback.hold else ""
        words.append(f"when {describe(callback.when)}{lasts}")
    return f"{', '.join(words)}: {'; '.join(map(_action, callback.actions))}"


def _action(action: plans.ActionPlan) -> str:
    words = ""
    match action:
        case plans.Switch(vehicle, state, values):
            words = f"switch {vehicle} to {_goal(state, values)}"
        case plans.Enable(vehicle, label, on):
            words = f"{'enable' if on else 'disable'} {label} of {vehicle}"
        case plans.Perform(vehicle, act):
            words = f"let {vehicle} perform {act}"
        case plans.SetOption(option, value):
            words = f"set {option} to {_number(value)}"
        case plans.Emit(name):
            words = f"emit {name}"
        case plans.EnterPhase(flow, phase):
            words = f"enter {phase} of {flow}"
        case plans.LogText(text):
            words = f"log `{text}`"
        case plans.Call(part):
            words = f"call {part.name}"
        case plans.Stop(reason):
            words = f"stop: {reason}"
    return words


def _fault(fault: plans.FaultPlan) -> str:
    """Format a fault, such as `wind on mk, when behavior == square, for 3 s`."""
    words = [f"{fault.part.name} on {fault.vehicle}"]
    if fault.time is not None:
        words.append(f"at {quantity(fault.time, DURATION)}")
    if fault.when is not None:
        words.append(f"when {describe(fault.when)}")
    if fault.duration is not None:
        words.append(f"for {quantity(fault.duration, DURATION)}")
    return ", ".join(words)
