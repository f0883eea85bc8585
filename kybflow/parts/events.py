"""The events that the engine emits.

An event is added here and where it is emitted; what missions may wait for, the schema and the table
in docs/parts.md follow. Behaviors and processors declare their own events beside themselves
(`own_events`), and a supervisor or a processor names its alarm (`AlarmRaised`).
"""

from __future__ import annotations

from kybflow.core.events import BaseEvent, RunEvent, VehicleEvent
from kybflow.core.units import Duration, Length, Speed


class RunStarted(RunEvent):
    """The run begins."""


class RunEnded(RunEvent):
    """The run is over."""

    awaited = "too late"
    reason: str | None


class RehearsalSkipped(RunEvent):
    """Hardware flies without a rehearsal, because somebody said so."""


class ObserverFailed(RunEvent):
    """Something that looks on was left out, because it raised."""

    reason: str


class RecordingStopped(RunEvent):
    """A part of the record is lost; the flight goes on."""

    reason: str


class CommandsFailed(RunEvent):
    """Commands are not served as they should be: the flight goes on."""

    reason: str


class ClientsRefusedEvent(RunEvent):
    """Clients, or what they sent, were refused; emitted every 10 s at most."""

    reason: str


class PreflightPassed(VehicleEvent):
    """A check before take-off is green."""

    check: str
    found: str


class PreflightFailed(VehicleEvent):
    """A check before take-off stayed red."""

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
    """A behavior waits for something to get out of its way, or for the vehicle."""

    behavior: str
    reason: str


class TookOff(VehicleEvent):
    """The vehicle is in the air."""


class Landed(VehicleEvent):
    """The vehicle is on the ground again."""


class LandingRefused(VehicleEvent):
    """A claim that the vehicle has landed contradicts its estimate: it flies on."""

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
    """The vehicle acknowledged that it let the payload go."""

    needs = "a payload"
    x: Length | None
    y: Length | None
    z: Length | None
    took: Duration | None


class PayloadAlreadyReleased(VehicleEvent):
    """A payload that was let go is to be let go again; it isn't."""

    needs = "a payload"


class SensorFailed(VehicleEvent):
    """A sensor beside the driver delivers nothing any more."""

    sensor: str
    reason: str


class SensorRecovered(VehicleEvent):
    """A sensor that had failed delivers again."""

    sensor: str


class MeasurementRefused(VehicleEvent):
    """Measurements that can't be true are left out; only the first is emitted."""

    source: str
    kind: str
    reason: str


class PositionRefused(VehicleEvent):
    """An estimator refuses the measured positions."""

    estimator: str
    reason: str


class PositionAccepted(VehicleEvent):
    """The estimator takes them again; it refused them for `value` seconds."""

    estimator: str
    value: Duration


class BodyLost(VehicleEvent):
    """Motion capture gives no pose of the vehicle any more."""

    needs = "motion capture"
    value: Duration
    bound: Duration


class BodyFroze(VehicleEvent):
    """Motion capture gives the same pose of the flying vehicle over and over."""

    needs = "motion capture"
    value: Duration
    bound: Duration


class BodyJumped(VehicleEvent):
    """In motion capture the vehicle is where no flight could have brought it."""

    needs = "motion capture"
    value: float
    bound: float


class BodySwapped(VehicleEvent):
    """The vehicle's body jumped to where another vehicle's body was."""

    needs = "motion capture"
    other: str
    value: float
    bound: float


class BodyRecovered(VehicleEvent):
    """A body that was lost or froze is seen again."""

    needs = "motion capture"


class CameraLostEvent(VehicleEvent):
    """A camera gives no frames any more."""

    needs = "a camera"
    camera: str
    value: Duration
    bound: Duration


class CameraFroze(VehicleEvent):
    """A camera of the flying vehicle gives the same image over and over."""

    needs = "a camera"
    camera: str
    value: Duration
    bound: Duration


class CameraJumped(VehicleEvent):
    """A camera shows the vehicle far from where the other sensors have it."""

    needs = "a camera"
    camera: str
    value: Length
    bound: Length


class CameraSwappedEvent(CameraJumped):
    """A camera sees the vehicle where another vehicle is."""

    other: str


class CameraRecovered(VehicleEvent):
    """A camera that was lost, froze or jumped is well again."""

    needs = "a camera"
    camera: str


class TagsLost(VehicleEvent):
    """Frames arrive in flight, but no tag is found in them."""

    needs = "a camera"
    value: Duration
    bound: Duration


class TagsFound(VehicleEvent):
    """Tags that were lost are seen again."""

    needs = "a camera"


class PartFailedEvent(VehicleEvent):
    """A part raised, or could not be made."""

    part: str
    reason: str


class ClampStarted(VehicleEvent):
    """A processor keeps the setpoint from where the behavior wants it."""

    processor: str
    reason: str


class ClampEnded(VehicleEvent):
    """The behavior is followed again; `most` was taken away."""

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
    """kybflow's failsafe gives the vehicle back to what it was doing."""

    reaction: str
    alarm: str | None


class LandModeStarted(VehicleEvent):
    """The vehicle lands by its own land mode."""


class LandModeRefused(VehicleEvent):
    """The vehicle's own land mode does not land it; `auto_land` does."""

    reason: str


class PreflightWaits(VehicleEvent):
    """A check before take-off is not green yet."""

    check: str
    reason: str


class ArmingRefused(VehicleEvent):
    """The vehicle won't arm, in its own words."""

    reason: str


class VehicleSaid(VehicleEvent):
    """The vehicle says something of itself."""

    severity: str
    text: str


class ForeignCommandEvent(VehicleEvent):
    """Somebody else commands the vehicle, beside this program."""

    needs = "other commanders"
    reason: str


class InputLost(RunEvent):
    """An input is unplugged, silent or stuck, or says what is no number."""

    input: str
    reason: str
    value: float | None = None
    bound: float | None = None


class InputRecovered(RunEvent):
    """An input that was lost is well again."""

    input: str


class ObstacleLost(RunEvent):
    """A moving obstacle is not seen any more."""

    obstacle: str
    reason: str


class ObstacleFound(RunEvent):
    """A moving obstacle that was lost is seen again."""

    obstacle: str


class ControlTaken(VehicleEvent):
    """Somebody else has the vehicle, and it is left alone."""

    needs = "other commanders"
    reason: str


class ControlRefused(VehicleEvent):
    """The vehicle was asked for back, and does not come: it is asked no more."""

    needs = "other commanders"
    reason: str


class ControlLost(VehicleEvent):
    """The vehicle's own failsafe took over, or it disarmed in the air."""

    reason: str


class ControlReturned(VehicleEvent):
    """The vehicle obeys again, and goes on with what it was doing."""


class LinkReturned(VehicleEvent):
    """The vehicle is heard again, after a silence."""

    value: Duration


class Paused(VehicleEvent):
    """The vehicle holds; what it was doing is frozen."""

    by: str


class Resumed(VehicleEvent):
    """The vehicle goes on with what it was doing when it was paused."""

    by: str


class PauseRefused(VehicleEvent):
    """The vehicle can't be paused now."""

    by: str
    reason: str


class SwitchRefused(VehicleEvent):
    """A state that was asked for can't be entered now."""

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


class PhaseRefused(RunEvent):
    """A phase that was asked for can't be entered now."""

    flow: str
    phase: str
    by: str
    reason: str


class FlowEnded(RunEvent):
    """A flow is over; `FLOW.finished` is emitted with it."""

    flow: str
    phase: str


class FlowFailed(RunEvent):
    """A flow could not go on; its vehicles do what they do."""

    flow: str
    reason: str


class DriverChanged(VehicleEvent):
    """Another flow drives the vehicle."""

    needs = "flows"
    flow: str


class GiveRefused(VehicleEvent):
    """A flow can't give a vehicle that it doesn't drive."""

    needs = "flows"
    flow: str
    to: str
    reason: str


class ProcessorEnabled(VehicleEvent):
    """A processor is in use again."""

    processor: str
    by: str


class ProcessorDisabled(VehicleEvent):
    """A processor is left out."""

    processor: str
    by: str


class Performed(VehicleEvent):
    """The vehicle was asked for an act of its driver."""

    act: str
    by: str


class PerformRefused(VehicleEvent):
    """An act that was asked for is not performed now."""

    act: str
    by: str
    reason: str


class Reset(VehicleEvent):
    """A fault was forgotten, on the ground."""

    by: str


class ResetRefused(VehicleEvent):
    """A fault can't be forgotten now."""

    by: str
    reason: str


class OptionChanged(VehicleEvent):
    """A parameter has another value."""

    option: str
    value: str
    by: str


class OptionRefusedEvent(VehicleEvent):
    """A parameter can't have the value."""

    option: str
    by: str
    reason: str


class FaultInjected(VehicleEvent):
    """A fault of the mission is at work on the vehicle."""

    awaited = "to log it"
    fault: str


class FaultEnded(VehicleEvent):
    """A fault's time is over."""

    awaited = "to log it"
    fault: str


class FaultFailed(VehicleEvent):
    """A fault could not be injected, or failed at work."""

    awaited = "to log it"
    fault: str
    reason: str


class RunStopped(RunEvent):
    """Somebody ends the run: every vehicle lands."""

    reason: str


class Logged(RunEvent):
    """A callback said something."""

    text: str


class ActionFailed(RunEvent):
    """An action of a package raised and was left out."""

    action: str
    reason: str


class Collided(VehicleEvent):
    """The vehicle ran into something."""

    awaited = "nowhere"
    into: str


class LandedHard(VehicleEvent):
    """The vehicle touched down too fast."""

    awaited = "nowhere"
    onto: str
    speed: Speed


class PayloadRested(VehicleEvent):
    """A payload that was let go came to rest."""

    awaited = "nowhere"
    x: Length
    y: Length
    z: Length


class LeaseTaken(RunEvent):
    """A client took the run over from another one."""

    awaited = "nowhere"
    by: str
    previous: str | None


class CommandGiven(RunEvent):
    """Somebody gave a command; it was heard at `heard_s`, if not when it was answered."""

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
"""The events of this page, by name."""
AWAITED_EVENTS = {name: e for name, e in ENGINE_EVENTS.items() if e.awaited != "nowhere"}
"""Those that a mission can know."""
RUN_EVENTS = frozenset(name for name, e in AWAITED_EVENTS.items() if issubclass(e, RunEvent))
"""Those of the whole run."""
VEHICLE_EVENTS = frozenset(AWAITED_EVENTS) - RUN_EVENTS
"""Those of a vehicle."""
