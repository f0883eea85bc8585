"""The observables of conditions and expectations, and the events that the engine emits.

The compiler reads an observable's type, the runtime its getter. In a condition `View.state` is the
estimate; in an expectation it is the simulator's truth, if there is one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from operator import attrgetter
from typing import NamedTuple, Protocol

from kybflow.core.geometry import Quat, Vec3, distance, heading_of, norm, tilt_of
from kybflow.core.signals import Battery, PayloadState, Setpoint, Sticks
from kybflow.core.units import ANGLE, DURATION, LENGTH, NUMBER, RATIO, SPEED, VOLTAGE, Dimension


class Unavailable(Exception):
    """A value is unknown now, such as an estimate; a comparison with it is false."""


def chains_of(state: str) -> tuple[str, ...]:
    """Return the chains that contain a state, outermost first: `a` and `a.b` for `a.b.c`."""
    if "." not in state:
        return ()
    return tuple(state[:i] for i, letter in enumerate(state) if letter == ".")


def is_in(behavior: str, state: str) -> bool:
    """Return whether `behavior`, a vehicle's state, is `state` or inside the chain `state`."""
    return behavior == state or ("." in behavior and behavior.startswith(f"{state}."))


class State(Protocol):
    """The common part of an Estimate and a Truth."""

    @property
    def position(self) -> Vec3:
        """In the world, metres."""

    @property
    def velocity(self) -> Vec3:
        """In the world, m/s."""

    @property
    def attitude(self) -> Quat:
        """Body to world."""


class View(Protocol):
    """One vehicle as observables read it. A property raises Unavailable while it is unknown."""

    @property
    def state(self) -> State:
        """The estimate or the truth."""

    @property
    def wanted(self) -> Setpoint:
        """The setpoint that the behavior asks for, before processors; Unavailable on the ground."""

    @property
    def battery(self) -> Battery:
        """The newest battery report."""

    @property
    def behavior(self) -> str:
        """The name of the active state, empty before the first."""

    @property
    def estimator(self) -> str:
        """The name of the estimator in use."""

    @property
    def elapsed(self) -> float:
        """Seconds since the active state was entered."""

    @property
    def start(self) -> Vec3:
        """The declared start in the world, metres."""

    @property
    def age(self) -> float:
        """The estimate's age, seconds."""

    @property
    def spread(self) -> float:
        """The standard deviation of the estimate's position, metres."""

    @property
    def payload(self) -> PayloadState:
        """Where the payload is, as the vehicle acknowledged it."""

    @property
    def payload_place(self) -> Vec3:
        """The payload's centre in the world, metres; Unavailable outside a simulator."""

    @property
    def releases(self) -> int:
        """How often the payload was released."""

    @property
    def sticks(self) -> Sticks:
        """A pilot's sticks; Unavailable without a transmitter or a ground station."""


class Envelope(NamedTuple):
    """How far a vehicle's values go, SI. start: its place on the ground. low, high: of its
    position. speed: of its velocity. error, velocity_error: how far it is from its setpoint. age:
    of the newest measurement. spread: what the best of sensors leaves."""

    start: Vec3
    low: Vec3
    high: Vec3
    speed: float
    tilt: float = pi
    error: float = inf
    velocity_error: float = inf
    age: float = inf
    spread: float = 0.0


@dataclass(frozen=True, slots=True)
class Observable:
    """A value that conditions and expectations can read by name. dimension: None for text (the name
    of a state or an estimator), which is compared with `==` and `!=`. low, high: its bounds, SI.
    words: the values that a text can have, if they are fixed. reach: its bounds on a vehicle that
    keeps to an envelope, None for those of every vehicle."""

    help: str
    dimension: Dimension | None
    read: Callable[[View], float | str]
    low: float = -inf
    high: float = inf
    words: tuple[str, ...] = ()
    reach: Callable[[Envelope], tuple[float, float]] | None = None

    def bounds(self, envelope: Envelope | None) -> tuple[float, float]:
        """Return the range that the value never leaves."""
        if envelope is None or self.reach is None:
            return self.low, self.high
        low, high = self.reach(envelope)
        return max(low, self.low), min(high, self.high)


def _position_error(view: View) -> float:
    position = view.wanted.position
    if position is None:
        raise Unavailable
    return distance(position, view.state.position)


def _velocity_error(view: View) -> float:
    velocity = view.wanted.velocity
    if velocity is None:
        raise Unavailable
    return distance(velocity, view.state.velocity)


OBSERVABLES: dict[str, Observable] = {
    "state.altitude": Observable(
        "Height above the world's zero.", LENGTH, lambda v: v.state.position[2],
        reach=lambda e: (e.low[2], e.high[2]),
    ),
    "state.x": Observable(
        "Position east.", LENGTH, lambda v: v.state.position[0],
        reach=lambda e: (e.low[0], e.high[0]),
    ),
    "state.y": Observable(
        "Position north.", LENGTH, lambda v: v.state.position[1],
        reach=lambda e: (e.low[1], e.high[1]),
    ),
    "state.speed": Observable(
        "Norm of the velocity.", SPEED, lambda v: norm(v.state.velocity), low=0.0,
        reach=lambda e: (0.0, e.speed),
    ),
    "state.climb": Observable(
        "Vertical speed, up.", SPEED, lambda v: v.state.velocity[2],
        reach=lambda e: (-e.speed, e.speed),
    ),
    "state.tilt": Observable(
        "Angle between body z and world z.", ANGLE, lambda v: tilt_of(v.state.attitude), 0.0, pi,
        reach=lambda e: (0.0, e.tilt),
    ),
    "state.heading": Observable(
        "Heading from east.", ANGLE, lambda v: heading_of(v.state.attitude), -pi, pi
    ),
    "battery.remaining": Observable(
        "Charge left, 0 to 100 %.", RATIO, lambda v: v.battery.remaining, 0.0, 1.0
    ),
    "battery.voltage": Observable(
        "Voltage of the battery.", VOLTAGE, lambda v: v.battery.voltage, low=0.0
    ),
    "estimate.age": Observable(
        "Age of the newest measurement in the estimate.", DURATION, attrgetter("age"), low=0.0,
        reach=lambda e: (0.0, e.age),
    ),
    "estimate.spread": Observable(
        "Standard deviation of the position.", LENGTH, attrgetter("spread"), low=0.0,
        reach=lambda e: (e.spread, e.error),
    ),
    "position_error": Observable(
        "Distance in the air from where the behavior wants it.", LENGTH, _position_error, low=0.0,
        reach=lambda e: (0.0, e.error),
    ),
    "velocity_error": Observable(
        "Norm of the velocity's difference in the air from what the behavior wants.",
        SPEED,
        _velocity_error,
        low=0.0,
        reach=lambda e: (0.0, e.velocity_error),
    ),
    "elapsed": Observable("Time in the present behavior.", DURATION, lambda v: v.elapsed, low=0.0),
    "behavior": Observable("Name of the present state.", None, lambda v: v.behavior),
    "estimator": Observable("Name of the estimator in use.", None, lambda v: v.estimator),
    "payload": Observable(
        "Where the payload is, as the vehicle acknowledged it.",
        None,
        lambda v: v.payload.value,
        words=tuple(state.value for state in PayloadState),
    ),
    "payload.releases": Observable(
        "How often it was released.", NUMBER, lambda v: float(v.releases), low=0.0
    ),
    "sticks.roll": Observable(
        "A pilot's stick, 1 to the right.", NUMBER, lambda v: v.sticks.roll, -1.0, 1.0
    ),
    "sticks.pitch": Observable(
        "A pilot's stick, 1 forward.", NUMBER, lambda v: v.sticks.pitch, -1.0, 1.0
    ),
    "sticks.yaw": Observable(
        "A pilot's stick, 1 to the left.", NUMBER, lambda v: v.sticks.yaw, -1.0, 1.0
    ),
    "sticks.throttle": Observable(
        "A pilot's stick, 0 to 1.", NUMBER, lambda v: v.sticks.throttle, 0.0, 1.0
    ),
}  # fmt: skip

EVENTS: dict[str, str] = {
    "run_started": "The run begins.",
    "run_ended": "The run is over.",
    "rehearsal_skipped": "Hardware flies without a rehearsal, because somebody said so.",
    "observer_failed": "Something that looks on was left out, because it raised.",
    "recording_stopped": "A part of the record is lost; the flight goes on.",
    "commands_failed": "Commands are not served as they should be: the flight goes on.",
    "clients_refused": "Clients, or what they sent, were refused; told every 10 s at most.",
    "preflight_passed": "A check before take-off is green.",
    "preflight_failed": "A check before take-off stayed red.",
    "behavior_started": "A behavior was entered.",
    "behavior_ended": "A behavior was left.",
    "behavior_failed": "A behavior failed.",
    "behavior_waits": "A behavior waits for something to get out of its way, or for the vehicle.",
    "took_off": "The vehicle is in the air.",
    "landed": "The vehicle is on the ground again.",
    "landing_refused": "A claim that the vehicle has landed contradicts its estimate: it flies on.",
    "stays_armed": "The vehicle has landed and was asked to disarm, but stays armed.",
    "estimator_changed": "Another estimator is in use.",
    "estimator_lost": "The estimator in use is lost, and no other can be used.",
    "payload_loaded": "The payload is on board.",
    "payload_released": "The vehicle acknowledged that it let the payload go.",
    "payload_already_released": "A payload that was let go is to be let go again; it isn't.",
    "sensor_failed": "A sensor beside the driver delivers nothing any more.",
    "sensor_recovered": "A sensor that had failed delivers again.",
    "measurement_refused": "Measurements that can't be true are left out; the first is told.",
    "position_refused": "An estimator refuses the measured positions.",
    "position_accepted": "The estimator takes them again; it refused them for `value` seconds.",
    "body_lost": "Motion capture gives no pose of the vehicle any more.",
    "body_froze": "Motion capture gives the same pose of the flying vehicle over and over.",
    "body_jumped": "In motion capture the vehicle is where no flight could have brought it.",
    "body_swapped": "The same, and it is where another vehicle's body was.",
    "body_recovered": "A body that was lost or froze is seen again.",
    "camera_lost": "A camera gives no frames any more.",
    "camera_froze": "A camera of the flying vehicle gives the same image over and over.",
    "camera_jumped": "A camera shows the vehicle far from where the other sensors have it.",
    "camera_swapped": "The same, and another vehicle is there.",
    "camera_recovered": "A camera that was lost, froze or jumped is well again.",
    "tags_lost": "Frames arrive in flight, but no tag is found in them.",
    "tags_found": "Tags that were lost are seen again.",
    "part_failed": "A part raised, or could not be made.",
    "clamp_started": "A processor keeps the setpoint from where the behavior wants it.",
    "clamp_ended": "The behavior is followed again; `most` was taken away.",
    "failsafe_started": "kybflow's failsafe takes over.",
    "failsafe_ended": "kybflow's failsafe gives the vehicle back to what it was doing.",
    "land_mode_started": "The vehicle lands by its own land mode.",
    "land_mode_refused": "The vehicle's own land mode does not land it; `auto_land` does.",
    "preflight_waits": "A check before take-off is not green yet.",
    "arming_refused": "The vehicle won't arm, in its own words.",
    "vehicle_said": "The vehicle says something of itself.",
    "foreign_command": "Somebody else commands the vehicle, beside this program.",
    "input_lost": "An input is unplugged, silent or stuck, or says what is no number.",
    "input_recovered": "An input that was lost is well again.",
    "obstacle_lost": "A moving obstacle is not seen any more.",
    "obstacle_found": "A moving obstacle that was lost is seen again.",
    "control_taken": "Somebody else has the vehicle, and it is left alone.",
    "control_refused": "The vehicle was asked for back, and does not come: it is asked no more.",
    "control_lost": "The vehicle's own failsafe took over, or it disarmed in the air.",
    "control_returned": "The vehicle obeys again, and goes on with what it was doing.",
    "link_returned": "The vehicle is heard again, after a silence.",
    "paused": "The vehicle holds; what it was doing is frozen.",
    "resumed": "The vehicle goes on with what it was doing when it was paused.",
    "pause_refused": "The vehicle can't be paused now.",
    "switch_refused": "A state that was asked for can't be entered now.",
    "phase_started": "A flow entered a phase.",
    "phase_ended": "A flow left a phase.",
    "phase_refused": "A phase that was asked for can't be entered now.",
    "flow_ended": "A flow is over; `FLOW.finished` is told with it.",
    "flow_failed": "A flow could not go on; its vehicles do what they do.",
    "driver_changed": "Another flow drives the vehicle.",
    "give_refused": "A flow can't give a vehicle that it doesn't drive.",
    "processor_enabled": "A processor is in use again.",
    "processor_disabled": "A processor is left out.",
    "performed": "The vehicle was asked for an act of its driver.",
    "perform_refused": "An act that was asked for is not performed now.",
    "reset": "A fault was forgotten, on the ground.",
    "reset_refused": "A fault can't be forgotten now.",
    "option_changed": "A parameter has another value.",
    "option_refused": "A parameter can't have the value.",
    "fault_injected": "A fault of the mission is at work on the vehicle.",
    "fault_ended": "A fault's time is over.",
    "fault_failed": "A fault could not be injected, or failed at work.",
    "run_stopped": "Somebody ends the run: every vehicle lands.",
    "logged": "A callback said something.",
    "action_failed": "An action of a package raised and was left out.",
}
"""The events that the engine emits and their help; parts declare the events of their alarms."""
OF_THE_RUN = frozenset(
    {
        "run_started", "run_ended", "run_stopped", "observer_failed", "recording_stopped", "logged",
        "action_failed", "commands_failed", "clients_refused", "input_lost", "input_recovered",
        "obstacle_lost", "obstacle_found",
        "phase_started", "phase_ended", "phase_refused", "flow_ended",
        "flow_failed", "rehearsal_skipped",
    }
)  # fmt: skip
"""Events of the whole run, which belong to no vehicle."""
OF_BODIES = frozenset({"body_lost", "body_froze", "body_jumped", "body_swapped", "body_recovered"})
"""Events of vehicles that fly on motion capture."""
OF_CAMERAS = frozenset(
    {
        "camera_lost", "camera_froze", "camera_jumped", "camera_swapped", "camera_recovered",
        "tags_lost", "tags_found",
    }
)  # fmt: skip
"""Events of vehicles that fly on the frames of a camera."""
OF_A_PAYLOAD = frozenset({"payload_loaded", "payload_released", "payload_already_released"})
"""Events of vehicles that carry something."""
OF_OTHERS = frozenset({"control_taken", "control_refused", "foreign_command"})
"""Events of vehicles that somebody else may command too."""
OF_FLOWS = frozenset({"driver_changed", "give_refused"})
"""Events of vehicles that flows drive."""
OF_THE_SIMULATOR = frozenset({"fault_injected", "fault_ended", "fault_failed"})
"""Events that no vehicle could observe; callbacks may only log them."""
TOO_LATE = frozenset({"run_ended", "preflight_failed"})
"""Events after which no tick follows, so that nothing can react to them."""

ALARM_FIELDS = ("reaction", "reason", "value", "bound")
"""The fields of an alarm's event; `value` and `bound` are numbers."""
EVENT_FIELDS: dict[str, tuple[str, ...]] = {
    "run_started": (),
    "run_ended": ("reason",),
    "rehearsal_skipped": (),
    "observer_failed": ("reason",),
    "recording_stopped": ("reason",),
    "commands_failed": ("reason",),
    "clients_refused": ("reason",),
    "run_stopped": ("reason",),
    "logged": ("text",),
    "action_failed": ("action", "reason"),
    "preflight_passed": ("check", "found"),
    "preflight_failed": ("check", "reason"),
    "behavior_started": ("behavior", "part", "values"),
    "behavior_ended": ("behavior", "how"),
    "behavior_failed": ("behavior", "reason"),
    "behavior_waits": ("behavior", "reason"),
    "took_off": (),
    "landed": (),
    "landing_refused": ("behavior", "reason"),
    "stays_armed": ("reason",),
    "estimator_changed": ("estimator", "previous", "reason", "offset", "blended"),
    "estimator_lost": ("previous", "reason"),
    "payload_loaded": (),
    "payload_released": ("x", "y", "z", "took"),
    "payload_already_released": (),
    "sensor_failed": ("sensor", "reason"),
    "sensor_recovered": ("sensor",),
    "measurement_refused": ("source", "kind", "reason"),
    "position_refused": ("estimator", "reason"),
    "position_accepted": ("estimator", "value"),
    "body_lost": ("value", "bound"),
    "body_froze": ("value", "bound"),
    "body_jumped": ("value", "bound"),
    "body_swapped": ("other", "value", "bound"),
    "body_recovered": (),
    "camera_lost": ("camera", "value", "bound"),
    "camera_froze": ("camera", "value", "bound"),
    "camera_jumped": ("camera", "value", "bound"),
    "camera_swapped": ("camera", "other", "value", "bound"),
    "camera_recovered": ("camera",),
    "tags_lost": ("value", "bound"),
    "tags_found": (),
    "part_failed": ("part", "reason"),
    "failsafe_started": ALARM_FIELDS,
    "failsafe_ended": ("reaction", "alarm"),
    "clamp_started": ("processor", "reason"),
    "clamp_ended": ("processor", "most", "seconds"),
    "land_mode_started": (),
    "land_mode_refused": ("reason",),
    "preflight_waits": ("check", "reason"),
    "arming_refused": ("reason",),
    "vehicle_said": ("severity", "text"),
    "foreign_command": ("reason",),
    "input_lost": ("input", "reason", "value", "bound"),
    "input_recovered": ("input",),
    "obstacle_lost": ("obstacle", "reason"),
    "obstacle_found": ("obstacle",),
    "control_taken": ("reason",),
    "control_refused": ("reason",),
    "control_lost": ("reason",),
    "control_returned": (),
    "link_returned": ("value",),
    "paused": ("by",),
    "resumed": ("by",),
    "pause_refused": ("by", "reason"),
    "switch_refused": ("state", "by", "reason"),
    "phase_started": ("flow", "phase"),
    "phase_ended": ("flow", "phase", "how"),
    "phase_refused": ("flow", "phase", "by", "reason"),
    "flow_ended": ("flow", "phase"),
    "flow_failed": ("flow", "reason"),
    "driver_changed": ("flow",),
    "give_refused": ("flow", "to", "reason"),
    "processor_enabled": ("processor", "by"),
    "processor_disabled": ("processor", "by"),
    "performed": ("act", "by"),
    "perform_refused": ("act", "by", "reason"),
    "reset": ("by",),
    "reset_refused": ("by", "reason"),
    "option_changed": ("option", "value", "by"),
    "option_refused": ("option", "by", "reason"),
    "fault_injected": ("fault",),
    "fault_ended": ("fault",),
    "fault_failed": ("fault", "reason"),
}
"""The fields of each event in EVENTS, beside its vehicle and time. A part's event has ALARM_FIELDS,
a custom event none."""
