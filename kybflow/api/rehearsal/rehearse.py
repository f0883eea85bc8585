"""Flies a plan once on ideal vehicles, as fast as possible, and collects the findings.

Every driver becomes `kinematic`. Estimators become TrueState and trackers PassOn, with the names
and options of the originals. Sensors are left out, and faults have no effect
(`kybflow.api.rehearsal.faults`). Processors, supervisors, behaviors and flows stay. An input that a
person moves rests at its centre.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from kybflow.api.opening import NOTHING, PlanEntryJudge, assemble, open_devices
from kybflow.api.rehearsal import findings
from kybflow.api.rehearsal.faults import FaultWatch, harmless
from kybflow.api.rehearsal.person import Assumed, Person
from kybflow.api.rehearsal.watch import LeastCharge, LeastSeparation, Watch
from kybflow.api.validation import to_annotation, to_sarif
from kybflow.core.errors import PartFailed
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import (
    Command,
    CommandKind,
    Estimate,
    Event,
    Measurement,
    Odometry,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.core.units import format_measured
from kybflow.drivers.kinematic import Kinematic, KinematicParams
from kybflow.dsl.diagnostics import Diagnostic, Severity, has_errors, in_order, render_all, to_json
from kybflow.dsl.plan import EstimatorPlan, PartPlan, Plan
from kybflow.inputs.rows import InputRow, head, line
from kybflow.parts import Estimator, Tracker
from kybflow.runtime.clock import SimulatedClock
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.commanding.legal import check_emitted
from kybflow.runtime.events import Events
from kybflow.runtime.expectations import Verdict
from kybflow.runtime.preflight import PreflightResult
from kybflow.runtime.scores import Score
from kybflow.world.vehicle_context import VehicleContext


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """The result of a rehearsal.

    diagnostics: the findings, sorted. duration: the mission's duration, s. separation: None for a
    single vehicle. charge: None if no vehicle has a battery. assumed: the events that the rehearsal
    gave in place of a person.
    """

    mission: str
    target: str
    diagnostics: tuple[Diagnostic, ...]
    duration: float
    separation: LeastSeparation | None
    charge: LeastCharge | None
    assumed: tuple[Assumed, ...]

    @property
    def is_clean(self) -> bool:
        return not has_errors(self.diagnostics)


RATE = 25
"""Control rate, Hz: high enough for ideal vehicles, as every finding lasts longer than a period."""
_KINDS = {
    SetpointKind.POSITION: CommandKind.POSITION,
    SetpointKind.VELOCITY: CommandKind.VELOCITY,
    SetpointKind.ACCELERATION: CommandKind.ACCELERATION,
}


class TrueState(Estimator[Any]):
    """Returns the vehicle's odometry, which is exact and without delay."""

    needs = frozenset({Odometry})

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for one in measurements:
            if isinstance(one, Odometry):
                _, position, velocity, attitude, rates, _ = one
                return Estimate(now, position, velocity, attitude, rates, "truth", 0.0, 0.0)
        return None


class PassOn(Tracker[Any]):
    """Passes each setpoint on unchanged as a command."""

    accepts = frozenset(_KINDS)
    emits = CommandKind.POSITION

    def __init__(self, params: Any, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._hover = context.airframe.hover_thrust

    @property
    def hover_thrust(self) -> float:
        return self._hover

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        return Command(LEVEL, self._hover, ZERO, None, True, _KINDS[setpoint.kind], setpoint)


def rehearse(
    plan: Plan,
    emitted: Sequence[tuple[float, str]] = (),
    options: Sequence[tuple[str, str]] = (),
    texts: Mapping[str, str] = NOTHING,
) -> Rehearsal:
    """Rehearse `plan`.

    emitted: a person's events as (seconds, name); the rehearsal then doesn't give these events
    itself. options: parameters of parts to change before take-off, as (name, value). texts: the
    mission's files, for the spans of findings. Raises EventRefused for an event that nothing waits
    for, OptionRefused for an option that can't be changed.
    """
    check_emitted(plan, (name for _, name in emitted))
    watch, faults, commands = Watch(plan, texts), FaultWatch(plan), CommandQueue(emitted)
    person = Person(plan, commands, (name for _, name in emitted))
    duration, verdicts = 0.0, tuple[Verdict, ...]()
    try:
        duration, verdicts = _flown(plan, watch, faults, person, commands, options)
        found = watch.diagnostics
        if not (found or person.assumed or at_rest(plan)):
            found = tuple(
                findings.unmet(
                    v.text, v.at, "" if v.value is None else format_measured(v.value, v.unit), texts
                )
                for v in faults.unexplained(verdicts)
            )
            found += tuple(faults.diagnostics(texts))
    except PartFailed as failure:
        made = ((vehicle.name, part) for vehicle in plan.vehicles for part in vehicle.parts)
        places = ((name, part.at) for name, part in made if part.label == failure.part)
        name, at = next(places, (plan.vehicles[0].name, plan.vehicles[0].at))
        found = (findings.stays_down(name, failure.part, str(failure), at, texts),)
    return Rehearsal(
        plan.mission, plan.target, in_order(found), duration, watch.separation, watch.charge,
        tuple(person.assumed),
    )  # fmt: skip


def _flown(
    plan: Plan,
    watch: Watch,
    faults: FaultWatch,
    person: Person,
    commands: CommandQueue,
    options: Sequence[tuple[str, str]],
) -> tuple[float, tuple[Verdict, ...]]:
    """Fly the ideal plan to its end; return the duration in seconds and the verdicts of its
    expectations. Raises RuntimeError if the watch or the person failed, because findings may then
    be missing."""
    failures: list[object] = []

    def note_failure(event: Event) -> None:
        if event.name == "observer_failed":
            failures.append(event.fields["reason"])

    flown = ideal(plan)
    events = Events((watch.on_event, faults.on_event, note_failure))
    clock, score = SimulatedClock(flown.control_rate), Score(flown)
    devices = open_devices(flown, 0, at_rest(plan))
    try:
        engine = assemble(
            flown, devices, events, clock, score, observers=(watch.on_tick, person),
            commands=commands, judge=PlanEntryJudge(plan), options=options,
        )  # fmt: skip
        watch.begin(engine)
        faults.begin(engine)
        unfinished = engine.run()
        watch.end(engine)
        if failures:
            raise RuntimeError(f"the rehearsal could not be watched: {failures[-1]}")
    finally:
        devices.close()
    seconds = engine.seconds()
    return seconds, engine.judge.verdicts(None if unfinished else engine.mission_seconds())


def ideal(plan: Plan) -> Plan:
    """Return the plan with ideal vehicles."""
    vehicles = []
    for vehicle in plan.vehicles:
        driver, charge = vehicle.driver, getattr(vehicle.driver.params, "battery", 1.0)
        kinematic = KinematicParams(battery=charge)
        estimator = replace(vehicle.estimators[0].part, cls=TrueState)
        ideal_vehicle = replace(
            vehicle,
            driver=PartPlan("kinematic", Kinematic, kinematic, driver.label, driver.at),
            estimators=(EstimatorPlan(part=estimator),),
            tracker=replace(vehicle.tracker, cls=PassOn),
            sensors=(),
        )
        vehicles.append(ideal_vehicle)
    return replace(
        harmless(plan),
        simulated=True,
        watching={},
        control_rate=min(RATE, plan.control_rate),
        vehicles=tuple(vehicles),
    )


def at_rest(plan: Plan) -> dict[str, str]:
    """Return, for each input that a person moves, a recorded table with all axes centred, by input
    name."""
    found = {}
    for own in plan.inputs:
        if own.part.cls.real_time(own.part.params):
            axes = own.part.cls.axes(own.part.params)
            found[own.name] = head(axes) + line(InputRow(0, dict.fromkeys(axes, 0.0)), axes)
    return found


def formatted(rehearsal: Rehearsal, texts: dict[str, str], format: str) -> Iterable[str]:
    """Return a rehearsal's texts in a format: `text`, `json`, `sarif` or `github`."""
    if format == "text":
        return reports(rehearsal, texts)
    if format == "json":
        separation, charge = rehearsal.separation, rehearsal.charge
        whole = {
            "kybflow": 1,
            "mission": rehearsal.mission,
            "target": rehearsal.target,
            "clean": rehearsal.is_clean,
            "duration_s": round(rehearsal.duration, 3),
            "separation": None if separation is None else separation._asdict(),
            "battery": None if charge is None else charge._asdict(),
            "assumed": [one._asdict() for one in rehearsal.assumed],
            "diagnostics": [to_json(d) for d in rehearsal.diagnostics],
        }
        return [json.dumps(whole, indent=2)]
    if format == "sarif":
        return [to_sarif(rehearsal.diagnostics)]
    return map(to_annotation, rehearsal.diagnostics)


def reports(rehearsal: Rehearsal, texts: dict[str, str]) -> Iterator[str]:
    """Yield a text for each finding and each assumed event, then a line of figures."""
    yield from render_all(rehearsal.diagnostics, texts)
    for seconds, name, waiting in rehearsal.assumed:
        yield f"assumed: a person gives `{name}` at {seconds:.1f} s, for which {waiting} waits"
    yield f"{rehearsal.mission} rehearsed: {_figures(rehearsal)}"


def _figures(rehearsal: Rehearsal) -> str:
    """Return the duration, least separation, least charge and number of findings, as a line of
    text."""
    words = [f"{rehearsal.duration:.1f} s"]
    if rehearsal.separation is not None:
        metres, seconds, (one, other) = rehearsal.separation
        words.append(f"`{one}` and `{other}` {metres:.2f} m apart at least ({seconds:.1f} s)")
    if rehearsal.charge is not None:
        words.append(f"battery of `{rehearsal.charge.vehicle}` {rehearsal.charge.remaining:.0%}")
    count = len(rehearsal.diagnostics)
    words += [f"{count} finding{'s' * (count > 1)}"] if count else []
    return ", ".join(words)


def preflight_line(rehearsal: Rehearsal) -> PreflightResult:
    errors = [d for d in rehearsal.diagnostics if d.severity is Severity.ERROR]
    if not errors:
        return PreflightResult("all", "rehearsal", True, _figures(rehearsal))
    more = f", and {len(errors) - 1} more" if len(errors) > 1 else ""
    reason = f"{errors[0].message}{more}: see `kybflow rehearse`"
    return PreflightResult("all", "rehearsal", False, reason, errors[0].span.at)
