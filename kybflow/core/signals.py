"""The signals between parts: measurements, estimates, setpoints, commands, alarms and events.

Immutable values of plain floats. `Time` is integer nanoseconds since the clock's zero; a signal
that is valid at one time carries it. World frame ENU, body frame FLU, SI units (REP 103);
quaternions rotate body to world.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Mapping
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, Protocol, TypeVar, cast

from kybflow.core.errors import EstimateMissing
from kybflow.core.geometry import Quat, Vec3

Time = int
"""Nanoseconds since the clock's zero."""
NS = 1_000_000_000
"""Nanoseconds in a second."""
NEVER: Time = 1 << 62
"""A time later than any other."""

T = TypeVar("T", bound=tuple[Any, ...])
made = cast(Callable[[type[T], tuple[Any, ...]], T], tuple.__new__)
"""Make a signal of a tuple of all its fields, in half the time that calling its class takes: for
those that every tick makes."""


class Measurement(Protocol):
    """What a sensor measured at `time`.

    A kind of measurement is a class: a NamedTuple of `time` and the measured values. An estimator
    `needs` kinds; a driver or a sensor `provides` them. The class is its only declaration: the
    runtime checks, counts, records and distributes a measurement by its fields. The recording has a
    topic and a message type named after the class, with the comments in `Annotated`. Recorded types
    are `Time`, `float`, `bool`, `Vec3` and `Quat`; with `Recorded`, which adds a field, also
    `T | None` and `tuple[float, ...]`. Each value of a `str` field gets a topic of its own; a field
    of type `Any` is not recorded.
    """

    @property
    def time(self) -> Time:
        """When the values were true, not when they arrived."""


MeasurementKind = type[Measurement]


def kind_name(kind: type) -> str:
    """Return a class's name in missions, messages and topics: `optical_flow` for OpticalFlow."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


class Recorded(NamedTuple):
    """How to record a field that needs one more field in the message. comment: documents the field.
    extra, extra_comment: the name and comment of the field before it, which says whether there is a
    value, or how many there are."""

    comment: str
    extra: str
    extra_comment: str


Stamp = Annotated[Time, "ns; when it was true. It arrived at the message's log time."]


class Pose(NamedTuple):
    """A pose from motion capture: position in the world, metres; attitude body to world."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    attitude: Quat


class BatteryWarning(NamedTuple):
    """A vehicle's own warning of a low battery, in words. acts: the vehicle's own failsafe acts on
    that, or would if it were set up to."""

    words: str
    acts: bool


class Battery(NamedTuple):
    """The battery as the vehicle reports it: the charge `remaining`, 0 to 1, its voltage, and the
    vehicle's own `warning` (a BatteryWarning), None while it gives none."""

    time: Stamp
    remaining: Annotated[float, "0 to 1"]
    voltage: Annotated[float, "V"]
    warning: Any = None


class Imu(NamedTuple):
    """The mean of the inertial sensors over the `dt` seconds before `time`, biases and noise
    included, in the body frame: specific force (m/s^2; at rest 9.81 upwards) and angular velocity
    (rad/s)."""

    time: Annotated[Time, "ns; the end of what it is the average of"]
    dt: Annotated[float, "s; how long that was"]
    specific_force: Annotated[Vec3, "m/s^2, body (FLU)"]
    angular_velocity: Annotated[Vec3, "rad/s, body"]


IMU_TIMEOUT: Time = NS // 10
"""After such a gap, the IMU says nothing of the motion since."""


class Frame(NamedTuple):
    """A camera's grey image, (height, width) uint8; `time` is mid-exposure of its middle row."""

    time: Annotated[Time, "ns; the middle of its exposure. It arrived at the message's log time."]
    camera: str
    image: Any


class Position(NamedTuple):
    """A position in the world from GPS, and its standard deviation along each axis, metres."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    spread: Annotated[Vec3, "m, standard deviation along each axis"]


class Payload(NamedTuple):
    """The vehicle's report of its payload: whether the servo that holds it is open, and whether it
    is on board, None if the vehicle can't tell. Sent when either changes, so it acknowledges that
    the servo moved."""

    time: Stamp
    is_open: Annotated[bool, "the servo that holds the payload"]
    aboard: Annotated[
        bool | None, Recorded("", "known", "false: the vehicle can't tell whether it is on board")
    ]


class Odometry(NamedTuple):
    """The state that an autopilot's own estimator reports: position and velocity in the world,
    attitude body to world, angular_velocity in the body. spread: the autopilot's standard deviation
    of the position, metres."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    velocity: Annotated[Vec3, "m/s, world"]
    attitude: Quat
    angular_velocity: Annotated[Vec3, "rad/s, body"]
    spread: Annotated[float, "m, standard deviation of the position"]


class Sticks(NamedTuple):
    """A pilot's sticks, from a transmitter or a ground station: -1 to 1, positive roll to the
    right, pitch forward, yaw to the left; throttle 0 to 1; and the switches, each -1 to 1."""

    time: Stamp
    roll: Annotated[float, "-1 to 1, to the right"]
    pitch: Annotated[float, "-1 to 1, forward"]
    yaw: Annotated[float, "-1 to 1, to the left"]
    throttle: Annotated[float, "0 to 1"]
    switches: Annotated[
        tuple[float, ...],
        Recorded("-1 to 1", "count", "how many switches there are; the rest is zero"),
    ] = ()


class PayloadState(Enum):
    """Where the payload is, as the vehicle acknowledged it. ABSENT: none was loaded."""

    ABOARD = "aboard"
    RELEASED = "released"
    ABSENT = "absent"


class Estimate(NamedTuple):
    """The vehicle's state at `time`, as an estimator computed it.

    position, velocity: in the world. attitude: body to world. angular_velocity: in the body.
    source: the estimator's name. age: seconds since its newest measurement was true. spread:
    standard deviation of the position, metres.
    """

    time: Time
    position: Vec3
    velocity: Vec3
    attitude: Quat
    angular_velocity: Vec3
    source: str
    age: float
    spread: float


class Truth(NamedTuple):
    """The true state in a simulator; only the recorder and the expectations may read it. payload:
    the centre of the payload, on board or not; None without one."""

    position: Vec3
    velocity: Vec3
    attitude: Quat
    angular_velocity: Vec3
    payload: Vec3 | None = None


class SetpointKind(Enum):
    """What the tracker follows in a setpoint. IDLE: rotors at rest, on the ground."""

    IDLE = "idle"
    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"


class Setpoint(NamedTuple):
    """Where the vehicle should be now and how it should move, in the world frame.

    A POSITION setpoint has position, velocity, acceleration and jerk (fed forward, zero at rest); a
    VELOCITY setpoint has no position, an ACCELERATION setpoint no position and no velocity. The
    tracker follows `heading` (rad) and feeds `heading_rate` (rad/s) forward; where `heading` is
    None, it turns at `heading_rate` from the heading that it followed last.
    """

    kind: SetpointKind
    position: Vec3 | None = None
    velocity: Vec3 | None = None
    acceleration: Vec3 | None = None
    jerk: Vec3 | None = None
    heading: float | None = None
    heading_rate: float = 0.0


class CommandKind(Enum):
    """What the on-board controller follows; a tracker emits kinds, a driver accepts them."""

    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    ATTITUDE_THRUST = "attitude_thrust"
    RATES_THRUST = "rates_thrust"
    TILT_CLIMB = "tilt_climb"


class Command(NamedTuple):
    """What the on-board controller should follow; `kind` says which fields count.

    ATTITUDE_THRUST: `attitude` (body to world), `thrust` (newtons along body z) and `rates` (body,
    rad/s), fed forward. RATES_THRUST: `rates` and `thrust`. POSITION, VELOCITY and ACCELERATION:
    `setpoint`, which has at least that field; its other fields are fed forward. TILT_CLIMB: the
    tilt of `attitude`, the heading rate about body z of `rates`, and the climb rate, the velocity
    of `setpoint` along z. `armed` false stops
    the rotors. heading: the estimated heading, for an on-board filter that can't observe it, as an
    autopilot takes it from external vision; if None, it is unknown, the heading in `attitude` is
    meaningless, and the on-board controller holds its own.
    """

    attitude: Quat
    thrust: float
    rates: Vec3
    heading: float | None
    armed: bool = True
    kind: CommandKind = CommandKind.ATTITUDE_THRUST
    setpoint: Setpoint | None = None


class Reaction(IntEnum):
    """What the failsafe does, in order of severity; the severest in a tick wins."""

    WARN = 1
    BRAKE = 2
    GO_HOME = 3
    LAND = 4
    LAND_BLIND = 5
    CUT = 6


ReactionName = Literal["warn", "brake", "go_home", "land", "land_blind", "cut"]
"""A reaction's name, as a mission chooses it for a supervisor."""


class Alarm(NamedTuple):
    """A crossed bound: the event's name in the past tense, the reaction, the reason, and the
    measured value and the bound, None where there is no number. is_failure: the mission has failed
    with it, even if the vehicle lands well."""

    event: str
    reaction: Reaction
    reason: str
    value: float | None = None
    bound: float | None = None
    is_failure: bool = False


class Done(NamedTuple):
    """A behavior's last update when it ended normally; the tracker still follows its setpoint."""

    setpoint: Setpoint


class Failed(NamedTuple):
    """A behavior's last update when it failed, and why; the tracker still follows its setpoint."""

    setpoint: Setpoint
    reason: str


class Grip(NamedTuple):
    """A behavior's update that also opens or closes the servo that holds the payload. A behavior
    returns it until the vehicle has acknowledged it."""

    setpoint: Setpoint
    is_open: bool


class Retune(NamedTuple):
    """A processor's setpoint, and new values (SI) of options that the class of its vehicle's
    tracker declares, by name. They take effect at the next tick, as with `set`."""

    output: Setpoint
    options: Mapping[str, float]


class PlannedPoint(NamedTuple):
    """Where an external planner wants a vehicle at `time`: seconds of the run; position, velocity
    and acceleration in the world; heading in radians, None to keep it."""

    time: float
    position: Vec3
    velocity: Vec3 = (0.0, 0.0, 0.0)
    acceleration: Vec3 = (0.0, 0.0, 0.0)
    heading: float | None = None


FieldValue = str | float | bool | None
"""What a field of an event can be."""


class Event(NamedTuple):
    """An event as it is recorded (`kybflow.core.events` declares them). at: the mission line that
    caused it, or empty."""

    time: Time
    name: str
    vehicle: str
    fields: dict[str, FieldValue]
    at: str = ""


CENTRE = 0.05
"""How far from zero an axis of an input may be at rest."""


class InputReading(NamedTuple):
    """A reading of a person's input: each axis by name, -1 to 1, and the names of the pressed
    buttons. heard: when the device sent it, or last had nothing new. engaged: its dead-man switch
    is held, or it has none."""

    heard: Time
    axes: Mapping[str, float]
    held: frozenset[str] = frozenset()
    engaged: bool = True

    def is_centred(self, axes: Iterable[str]) -> bool:
        """Return whether each of these axes is at rest."""
        return all(abs(self.axes[axis]) <= CENTRE for axis in axes)


InputReadings = Mapping[str, InputReading | None]
"""The reading of each input, by its name in the mission; None while the input is lost."""
NO_INPUTS: InputReadings = MappingProxyType({})


class SeenObstacle(NamedTuple):
    """A moving obstacle when it was seen last: a ball in the world frame, SI. speed: the fastest
    that it goes."""

    time: Time
    position: Vec3
    velocity: Vec3
    radius: float
    speed: float


SeenObstacles = Mapping[str, SeenObstacle]
"""The moving obstacles that were ever seen, by name."""
NO_OBSTACLES: SeenObstacles = MappingProxyType({})


class NeighbourState(NamedTuple):
    """The state that a vehicle published to its neighbours at the end of the tick at `time`: its
    estimate, the setpoint that it followed, and its behavior's `says`; None where there is none."""

    time: Time
    estimate: Estimate | None
    setpoint: Setpoint | None
    said: Measurement | None


Answer = TypeVar("Answer")


class Neighbours(Protocol):
    """What vehicles publish to each other, kept for half a second."""

    def heard(self, vehicle: str, by: Time) -> NeighbourState | None:
        """Return the newest that the vehicle published at `by` or before; None where it published
        nothing yet."""

    def once(self, question: Hashable, answer: Callable[[], Answer]) -> Answer:
        """Return the `answer` to a `question` about the neighbours; it is computed once a tick, for
        the first that asks."""


class _Nobody:
    def heard(self, vehicle: str, by: Time) -> NeighbourState | None:
        return None

    def once(self, question: Hashable, answer: Callable[[], Answer]) -> Answer:
        return answer()


NOBODY: Neighbours = _Nobody()


class Tick(NamedTuple):
    """What a vehicle's parts see in one tick.

    now: the tick's time. dt: seconds since the vehicle's last tick. elapsed: seconds since the
    behavior was entered. fleet: every vehicle's estimate by name, frozen before any behavior runs,
    None for a vehicle without one. setpoint: the one that the tracker followed in the last tick.
    imu: the newest, if the vehicle subscribes to it. link_age: seconds since the link last
    delivered anything. link_delay: seconds of a round trip to the vehicle, zero while unknown.
    payload: where the payload is, None while unknown. inputs: what the
    mission's inputs say. neighbours: what the vehicles have published in earlier ticks. moving: the
    moving obstacles.
    """

    now: Time
    dt: float
    elapsed: float
    estimate: Estimate | None
    battery: Battery | None
    setpoint: Setpoint | None
    fleet: dict[str, Estimate | None]
    imu: Imu | None = None
    link_age: float = 0.0
    link_delay: float = 0.0
    payload: PayloadState | None = None
    inputs: InputReadings = NO_INPUTS
    neighbours: Neighbours = NOBODY
    moving: SeenObstacles = NO_OBSTACLES

    def known(self) -> Estimate:
        """Return the estimate. Raises EstimateMissing if there is none."""
        if self.estimate is None:
            raise EstimateMissing("no estimator has an estimate")
        return self.estimate
