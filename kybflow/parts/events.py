"""The events that the engine emits.

To add an event, define it here and emit it; the events that missions can wait for, the schema and
the table in docs/parts.md follow. Behaviors and processors declare their own events beside
themselves (`own_events`), and a supervisor or a processor names its alarm (`AlarmRaised`).
"""

from __future__ import annotations

from kybflow.core.events import BaseEvent, RunEvent, VehicleEvent
from kybflow.core.units import Duration, Force, Length, Speed


class RunStarted(RunEvent):
    """The run begins."""


class RunEnded(RunEvent):
    """The run is over."""

    awaited = "too late"
    reason: str | None


class RehearsalSkipped(RunEvent):
    """Hardware flies without a rehearsal, as an option allows."""


class ObserverFailed(RunEvent):
    """An observer of the run raised and is not called again."""

    reason: str
    traceback: str = ""


class TicksMissed(RunEvent):
    """The computer is late: it made only the share `value` of the ticks that were due."""

    reason: str
    value: float
    bound: float


class RecordingStopped(RunEvent):
    """A part of the recording is lost; the flight goes on."""

    reason: str


class CommandsFailed(RunEvent):
    """The command server can't serve clients as configured; the flight goes on."""

    reason: str


class ClientsRefusedEvent(RunEvent):
    """Clients, or their messages, were refused; emitted every 10 s at most."""

    reason: str


class PreflightPassed(VehicleEvent):
    """A check before take-off passed."""

    check: str
    found: str


class PreflightFailed(VehicleEvent):
    """A check before take-off failed."""

    awaited = "too late"
    check: str
    reason: str


class BehaviorStarted(VehicleEvent):
    """A behavior was entered."""

    behavior: str
    part: str
    values: str = ""


class BehaviorEnded(VehicleEvent):
    """A behavior was left."""

    behavior: str
    how: str


class BehaviorFailed(VehicleEvent):
    """A behavior failed."""

    behavior: str
    reason: str


class BehaviorWaits(VehicleEvent):
    """A behavior waits for a free path, or for the vehicle."""

    behavior: str
    reason: str


class TookOff(VehicleEvent):
    """The vehicle is in the air."""


class Landed(VehicleEvent):
    """The vehicle is on the ground again."""


class LandingRefused(VehicleEvent):
    """The estimate contradicts a claim that the vehicle has landed; the vehicle flies on."""

    behavior: str
    reason: str


class StaysArmed(VehicleEvent):
    """The vehicle has landed and was asked to disarm, but stays armed."""

    reason: str


class EstimatorChanged(VehicleEvent):
    """Another estimator is in use."""

    estimator: str
    previous: str | None
    reason: str
    offset: Length
    blended: bool


class EstimatorLost(VehicleEvent):
    """The estimator in use is lost, and no other can be used."""

    previous: str | None
    reason: str


class PayloadLoaded(VehicleEvent):
    """The payload is on board."""

    needs = "a payload"


class PayloadReleased(VehicleEvent):
    """The vehicle acknowledged the release of its payload."""

    needs = "a payload"
    x: Length | None
    y: Length | None
    z: Length | None
    took: Duration | None


class PayloadAlreadyReleased(VehicleEvent):
    """A request to release a payload that was released before is ignored."""

    needs = "a payload"


class SensorFailed(VehicleEvent):
    """A sensor beside the driver stopped delivering."""

    sensor: str
    reason: str


class SensorRecovered(VehicleEvent):
    """A sensor that had failed delivers again."""

    sensor: str


class MeasurementRefused(VehicleEvent):
    """Implausible measurements are discarded; only the first is reported."""

    source: str
    kind: str
    reason: str


class PositionRefused(VehicleEvent):
    """An estimator refuses the measured positions."""

    estimator: str
    reason: str


class PositionAccepted(VehicleEvent):
    """The estimator accepts measured positions again, after refusing them for `value` seconds."""

    estimator: str
    value: Duration


class BodyLost(VehicleEvent):
    """Motion capture lost the vehicle."""

    needs = "motion capture"
    value: Duration
    bound: Duration


class BodyFroze(VehicleEvent):
    """Motion capture repeats one pose of the flying vehicle."""

    needs = "motion capture"
    value: Duration
    bound: Duration


class BodyJumped(VehicleEvent):
    """Motion capture shows the vehicle at a place that it can't have reached."""

    needs = "motion capture"
    value: float
    bound: float


class BodySwapped(VehicleEvent):
    """In motion capture the vehicle jumped to another vehicle's position."""

    needs = "motion capture"
    other: str
    value: float
    bound: float


class BodyRecovered(VehicleEvent):
    """A body that was lost or froze is seen again."""

    needs = "motion capture"


class CameraLostEvent(VehicleEvent):
    """A camera stopped delivering frames."""

    needs = "a camera"
    camera: str
    value: Duration
    bound: Duration


class CameraFroze(VehicleEvent):
    """A camera of the flying vehicle repeats one image."""

    needs = "a camera"
    camera: str
    value: Duration
    bound: Duration


class CameraJumped(VehicleEvent):
    """A camera shows the vehicle far from its position by the other sensors."""

    needs = "a camera"
    camera: str
    value: Length
    bound: Length


class CameraSwappedEvent(CameraJumped):
    """A camera shows the vehicle at another vehicle's position."""

    other: str


class CameraRecovered(VehicleEvent):
    """A camera that was lost, froze or jumped works again."""

    needs = "a camera"
    camera: str


class TagsLost(VehicleEvent):
    """Frames arrive in flight, but show no tag."""

    needs = "a camera"
    value: Duration
    bound: Duration


class TagsFound(VehicleEvent):
    """Tags that were lost are seen again."""

    needs = "a camera"


class PartFailedEvent(VehicleEvent):
    """A part raised, or could not be created."""

    part: str
    reason: str
    traceback: str = ""


class ClampStarted(VehicleEvent):
    """A processor keeps the setpoint from the behavior's goal."""

    processor: str
    reason: str


class ClampEnded(VehicleEvent):
    """The processor stopped changing the setpoint; `most` is the largest change."""

    processor: str
    most: str
    seconds: Duration


class FailsafeStarted(VehicleEvent):
    """kybflow's failsafe takes over."""

    reaction: str
    reason: str
    value: float | None = None
    bound: float | None = None


class FailsafeEnded(VehicleEvent):
    """kybflow's failsafe hands the vehicle back to its behavior."""

    reaction: str
    alarm: str | None


class LandModeStarted(VehicleEvent):
    """The vehicle lands by its own land mode."""


class LandModeRefused(VehicleEvent):
    """The vehicle's own land mode failed; `auto_land` lands it."""

    reason: str


class PreflightWaits(VehicleEvent):
    """A check before take-off has not passed yet."""

    check: str
    reason: str


class ArmingRefused(VehicleEvent):
    """The vehicle refuses to arm; `reason` is its own message."""

    reason: str


class VehicleSaid(VehicleEvent):
    """The vehicle sent a status text."""

    severity: str
    text: str


class ForeignCommandEvent(VehicleEvent):
    """Another program or person commands the vehicle."""

    needs = "other commanders"
    reason: str


class InputLost(RunEvent):
    """An input is unplugged, silent or stuck, or delivers invalid numbers."""

    input: str
    reason: str
    value: float | None = None
    bound: float | None = None


class InputRecovered(RunEvent):
    """An input that was lost works again."""

    input: str


class ObstacleLost(RunEvent):
    """A moving obstacle is no longer seen."""

    obstacle: str
    reason: str


class ObstacleFound(RunEvent):
    """A moving obstacle that was lost is seen again."""

    obstacle: str


class ObjectLost(RunEvent):
    """Motion capture no longer sees an object of the world."""

    object: str
    reason: str


class ObjectFound(RunEvent):
    """An object that was lost is seen again."""

    object: str


class ControlTaken(VehicleEvent):
    """A pilot has taken the vehicle over; kybflow sends it no commands."""

    needs = "other commanders"
    reason: str


class ControlRefused(VehicleEvent):
    """The vehicle did not return control on request; kybflow stops requesting it."""

    needs = "other commanders"
    reason: str


class ControlLost(VehicleEvent):
    """The vehicle's own failsafe took over, or it disarmed in the air."""

    reason: str


class ControlReturned(VehicleEvent):
    """The vehicle follows commands again and continues its behavior."""


class LinkReturned(VehicleEvent):
    """Data from the vehicle arrive again."""

    value: Duration


class Paused(VehicleEvent):
    """The vehicle holds its position; its behavior is frozen."""

    by: str


class Resumed(VehicleEvent):
    """The vehicle continues the behavior that was paused."""

    by: str


class PauseRefused(VehicleEvent):
    """The vehicle can't be paused now."""

    by: str
    reason: str


class SwitchRefused(VehicleEvent):
    """A requested state can't be entered now."""

    state: str
    by: str
    reason: str


class PhaseStarted(RunEvent):
    """A flow entered a phase."""

    flow: str
    phase: str


class PhaseEnded(RunEvent):
    """A flow left a phase."""

    flow: str
    phase: str
    how: str


class CoordinatorChanged(RunEvent):
    """The coordinator of a phase does something else; `state` is what."""

    flow: str
    state: str
    reason: str


class PhaseRefused(RunEvent):
    """A requested phase can't be entered now."""

    flow: str
    phase: str
    by: str
    reason: str


class FlowEnded(RunEvent):
    """A flow is over; `FLOW.finished` is emitted with it."""

    flow: str
    phase: str


class FlowFailed(RunEvent):
    """A flow failed and ended; its vehicles continue their behaviors."""

    flow: str
    reason: str


class DriverChanged(VehicleEvent):
    """Another flow controls the vehicle."""

    needs = "flows"
    flow: str


class GiveRefused(VehicleEvent):
    """A flow can't give a vehicle that it doesn't control."""

    needs = "flows"
    flow: str
    to: str
    reason: str


class ProcessorEnabled(VehicleEvent):
    """A processor is switched on again."""

    processor: str
    by: str


class ProcessorDisabled(VehicleEvent):
    """A processor is switched off."""

    processor: str
    by: str


class Performed(VehicleEvent):
    """The vehicle was requested to perform an act of its driver."""

    act: str
    by: str


class PerformRefused(VehicleEvent):
    """A requested act can't be performed now."""

    act: str
    by: str
    reason: str


class Reset(VehicleEvent):
    """A latched failsafe reaction was cleared on the ground."""

    by: str


class ResetRefused(VehicleEvent):
    """A latched failsafe reaction can't be cleared now."""

    by: str
    reason: str


class OptionChanged(VehicleEvent):
    """A parameter changed its value."""

    option: str
    value: str
    by: str


class OptionRefusedEvent(VehicleEvent):
    """A parameter refused a value."""

    option: str
    by: str
    reason: str


class FaultInjected(VehicleEvent):
    """A fault of the mission is injected."""

    awaited = "to log it"
    fault: str


class FaultEnded(VehicleEvent):
    """An injected fault ended."""

    awaited = "to log it"
    fault: str


class FaultFailed(VehicleEvent):
    """A fault could not be injected, or raised."""

    awaited = "to log it"
    fault: str
    reason: str
    traceback: str = ""


class RunStopped(RunEvent):
    """A person or a callback ended the run; every vehicle lands."""

    reason: str


class RunInterrupted(RunEvent):
    """A signal interrupted the run: every vehicle lands; the second one stops the commands."""

    awaited = "nowhere"
    by: str


class Logged(RunEvent):
    """A callback logged a text."""

    text: str


class ActionFailed(RunEvent):
    """An action of a package raised and is not called again."""

    action: str
    reason: str
    traceback: str = ""


class Collided(VehicleEvent):
    """The vehicle ran into something."""

    awaited = "nowhere"
    into: str


class ContactBegan(VehicleEvent):
    """The vehicle touches an object: its `surface`, or its box if that is empty."""

    awaited = "to log it"
    object: str
    surface: str


class ContactEnded(VehicleEvent):
    """The vehicle no longer touches an object, which it pressed for `lasted`, by up to `force`."""

    awaited = "to log it"
    object: str
    surface: str
    lasted: Duration
    force: Force


class LandedHard(VehicleEvent):
    """The vehicle touched down too fast."""

    awaited = "nowhere"
    onto: str
    speed: Speed


class FenceLeft(VehicleEvent):
    """The vehicle is outside the fence, whatever it estimates; the run fails."""

    awaited = "nowhere"
    beyond: Length


class PayloadRested(VehicleEvent):
    """A released payload came to rest."""

    awaited = "nowhere"
    x: Length
    y: Length
    z: Length


class LeaseTaken(RunEvent):
    """A client took control of the run from another client."""

    awaited = "nowhere"
    by: str
    previous: str | None


class CommandGiven(RunEvent):
    """A person gave a command; it arrived at `heard_s`, unless it was answered at once."""

    awaited = "nowhere"
    command: str
    by: str
    take: bool = False
    heard_s: Duration | None = None
    accepted: bool
    reason: str = ""


ENGINE_EVENTS: dict[str, type[BaseEvent]] = {
    event.name: event
    for event in [*globals().values()]
    if isinstance(event, type) and issubclass(event, BaseEvent) and event.__module__ == __name__
}
"""The events of this module, by name."""
AWAITED_EVENTS = {name: e for name, e in ENGINE_EVENTS.items() if e.awaited != "nowhere"}
"""The events that a mission can use, by name."""
RUN_EVENTS = frozenset(name for name, e in AWAITED_EVENTS.items() if issubclass(e, RunEvent))
"""The names of the awaited events that belong to the whole run."""
VEHICLE_EVENTS = frozenset(AWAITED_EVENTS) - RUN_EVENTS
"""The names of the awaited events that belong to a vehicle."""
