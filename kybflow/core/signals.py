"""The signals between parts: measurements, estimates, setpoints, commands, alarms and events.

Signals are immutable values of plain floats. `Time` is an integer number of nanoseconds since the
clock's zero; a signal that is valid at one time has a `time`. The world frame is ENU and the body
frame FLU, in SI units (REP 103); quaternions rotate body to world.
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
"""Make a signal from a tuple of all its fields, in half the time that a call of its class takes.
Used for signals that are made in every tick."""


class Measurement(Protocol):
    """What a sensor measured at `time`.

    Each kind of measurement is a class: a NamedTuple of `time` and the measured values. An
    estimator `needs` kinds; a driver or a sensor `provides` them. The class is the only declaration
    of a kind: the runtime checks, counts, records and distributes measurements by its fields. In
    the recording, the topic and the message type are named after the class, and the texts in
    `Annotated` become comments. A field is recorded if its type is `Time`, `float`, `bool`, `Vec3`
    or `Quat`; with `Recorded`, which adds a field to the message, it may also be `T | None` or
    `tuple[float, ...]`. Each value of a `str` field gets a separate topic. A field of type `Any` is
    not recorded.
    """

    @property
    def time(self) -> Time:
        """When the values were true, not when they arrived."""


MeasurementKind = type[Measurement]


def kind_name(kind: type) -> str:
    """Return the name of a class in missions, messages and topics: `optical_flow` for
    OpticalFlow."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


class Recorded(NamedTuple):
    """How to record a field that needs another field before it in the message. comment: the comment
    of the field. extra: the name of the other field, which says whether there is a value, or how
    many values there are. extra_comment: its comment."""

    comment: str
    extra: str
    extra_comment: str


Stamp = Annotated[Time, "ns; the time of measurement. It arrived at the message's log time."]


class Pose(NamedTuple):
    """A pose from motion capture: the position in the world, metres, and the attitude, body to
    world."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    attitude: Quat


class BatteryWarning(NamedTuple):
    """A low-battery warning of the vehicle. words: the text of the warning. acts: whether the
    vehicle's own failsafe reacts to it, or would if it were enabled."""

    words: str
    acts: bool


class Battery(NamedTuple):
    """The battery state that the vehicle reports. remaining: the charge, 0 to 1. voltage: V.
    warning: a BatteryWarning, or None."""

    time: Stamp
    remaining: Annotated[float, "0 to 1"]
    voltage: Annotated[float, "V"]
    warning: Any = None


class Imu(NamedTuple):
    """The mean output of the inertial sensors over the `dt` seconds before `time`, including biases
    and noise, in the body frame: specific force (m/s^2; 9.81 upwards at rest) and angular velocity
    (rad/s)."""

    time: Annotated[Time, "ns; the end of the averaging interval"]
    dt: Annotated[float, "s; the length of that interval"]
    specific_force: Annotated[Vec3, "m/s^2, body (FLU)"]
    angular_velocity: Annotated[Vec3, "rad/s, body"]


IMU_TIMEOUT: Time = NS // 10
"""After a gap longer than this, ns, the motion since the last IMU measurement is unknown."""


class Frame(NamedTuple):
    """A camera's grey image, (height, width) uint8. time: the middle of the exposure of its middle
    row."""

    time: Annotated[Time, "ns; the middle of its exposure. It arrived at the message's log time."]
    camera: str
    image: Any


class Position(NamedTuple):
    """A position from GPS, in the world frame, with its standard deviation along each axis,
    metres."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    spread: Annotated[Vec3, "m, standard deviation along each axis"]


class Payload(NamedTuple):
    """The vehicle's report of its payload. is_open: whether the servo that holds the payload is
    open. aboard: whether the payload is on board, None if the vehicle doesn't know. It is sent when
    either value changes, so it acknowledges that the servo moved."""

    time: Stamp
    is_open: Annotated[bool, "the servo that holds the payload"]
    aboard: Annotated[
        bool | None, Recorded("", "known", "false: the vehicle can't tell whether it is on board")
    ]


class Odometry(NamedTuple):
    """The state that an autopilot's own estimator reports. position, velocity: world frame.
    attitude: body to world. angular_velocity: body frame. spread: the autopilot's standard
    deviation of the position, metres."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    velocity: Annotated[Vec3, "m/s, world"]
    attitude: Quat
    angular_velocity: Annotated[Vec3, "rad/s, body"]
    spread: Annotated[float, "m, standard deviation of the position"]


class Sticks(NamedTuple):
    """The sticks of a vehicle's pilot, from a transmitter or a ground station, as the vehicle
    reports them; an operator's devices give an `InputReading` instead. roll, pitch, yaw: -1 to 1,
    positive to the right, forward and to the left. throttle: 0 to 1. switches: -1 to 1 each."""

    time: Stamp
    roll: Annotated[float, "-1 to 1, to the right"]
    pitch: Annotated[float, "-1 to 1, forward"]
    yaw: Annotated[float, "-1 to 1, to the left"]
    throttle: Annotated[float, "0 to 1"]
    switches: Annotated[
        tuple[float, ...],
        Recorded("-1 to 1", "count", "number of switches; the rest is zero"),
    ] = ()


class PayloadState(Enum):
    """Where the payload is, according to the vehicle. ABSENT: none was loaded."""

    ABOARD = "aboard"
    RELEASED = "released"
    ABSENT = "absent"


class Estimate(NamedTuple):
    """The vehicle's state at `time`, as an estimator computed it.

    position, velocity: world frame. attitude: body to world. angular_velocity: body frame. source:
    the estimator's name. age: seconds since its newest measurement was true. spread: the standard
    deviation of the position, metres.
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
    the position of the payload's centre, on board or not; None if the vehicle has no payload."""

    position: Vec3
    velocity: Vec3
    attitude: Quat
    angular_velocity: Vec3
    payload: Vec3 | None = None


class SetpointKind(Enum):
    """The part of a setpoint that the tracker follows. IDLE: rotors at rest, on the ground."""

    IDLE = "idle"
    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"


class Setpoint(NamedTuple):
    """Where the vehicle should be now and how it should move, in the world frame.

    A POSITION setpoint has position, velocity, acceleration and jerk; the derivatives are fed
    forward and are zero at rest. A VELOCITY setpoint has no position; an ACCELERATION setpoint has
    neither position nor velocity. The tracker follows `heading` (rad) and feeds `heading_rate`
    (rad/s) forward; if `heading` is None, it turns at `heading_rate`, starting from the heading
    that it followed last. presses: the horizontal unit vector along which the vehicle presses
    against something; the tracker doesn't counter what pushes the vehicle back. The acceleration of
    such a setpoint is the force per mass with which it presses, and no change of its velocity; it
    bypasses the processors.
    """

    kind: SetpointKind
    position: Vec3 | None = None
    velocity: Vec3 | None = None
    acceleration: Vec3 | None = None
    jerk: Vec3 | None = None
    heading: float | None = None
    heading_rate: float = 0.0
    presses: Vec3 | None = None


class CommandKind(Enum):
    """The quantity that the on-board controller follows. A tracker emits some kinds, and a driver
    accepts some kinds."""

    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    ATTITUDE_THRUST = "attitude_thrust"
    RATES_THRUST = "rates_thrust"
    TILT_CLIMB = "tilt_climb"


class Command(NamedTuple):
    """What the on-board controller should follow. `kind` determines which fields it uses.

    - ATTITUDE_THRUST: `attitude` (body to world), `thrust` (newtons along body z), and `rates`
      (body frame, rad/s) as feed-forward.
    - RATES_THRUST: `rates` and `thrust`.
    - POSITION, VELOCITY, ACCELERATION: `setpoint`, which has at least that field; its other fields
      are fed forward.
    - TILT_CLIMB: the tilt of `attitude`, the z component of `rates` as the heading rate, and the z
      component of the velocity of `setpoint` as the climb rate.

    armed: if false, the rotors stop. heading: the estimated heading, rad, for an on-board filter
    that can't observe it (an autopilot takes it from external vision). If it is None, the heading
    is unknown, the heading in `attitude` is meaningless, and the on-board controller holds its own
    heading.
    """

    attitude: Quat
    thrust: float
    rates: Vec3
    heading: float | None
    armed: bool = True
    kind: CommandKind = CommandKind.ATTITUDE_THRUST
    setpoint: Setpoint | None = None


class Reaction(IntEnum):
    """What the failsafe does, by rising severity. The severest reaction in a tick takes effect."""

    WARN = 1
    BRAKE = 2
    GO_HOME = 3
    LAND = 4
    LAND_BLIND = 5
    CUT = 6


ReactionName = Literal["warn", "brake", "go_home", "land", "land_blind", "cut"]
"""The name of a reaction, as a mission writes it for a supervisor."""


ExitName = Literal["next", "done", "failed", "within", "refused", "asked", "failsafe", "operator"]
"""How a behavior or a phase ended, as `how` of the events `behavior_ended` and `phase_ended`."""


class Alarm(NamedTuple):
    """The report that a bound was crossed. event: the name of the event, in the past tense.
    reaction: what the failsafe does. value, bound: the measured value and the bound, None if they
    are not numbers. is_failure: whether the mission counts as failed even if the vehicle lands
    well. late: by how much later than usual commands take effect, s; the vehicle then doesn't
    follow its setpoint. passes: whether the cause has passed once the vehicle has braked and stands
    still."""

    event: str
    reaction: Reaction
    reason: str
    value: float | None = None
    bound: float | None = None
    is_failure: bool = False
    late: float = 0.0
    passes: bool = False


class Done(NamedTuple):
    """A behavior's last update, when it ended normally. The tracker still follows its setpoint."""

    setpoint: Setpoint


class Failed(NamedTuple):
    """A behavior's last update, when it failed. reason: why. The tracker still follows its
    setpoint."""

    setpoint: Setpoint
    reason: str


class Grip(NamedTuple):
    """A behavior's update that also opens or closes the servo that holds the payload. A behavior
    returns it until the vehicle has acknowledged it."""

    setpoint: Setpoint
    is_open: bool


class Retune(NamedTuple):
    """A processor's setpoint with new values of the tracker's options. options: the values (SI) by
    the names that the tracker's class declares. They take effect in the next tick, as with
    `set`."""

    output: Setpoint
    options: Mapping[str, float]


class PlannedPoint(NamedTuple):
    """Where an external planner wants a vehicle at `time`. time: seconds of the run. position,
    velocity, acceleration: world frame; a velocity or acceleration that is None follows from the
    points around it. heading: rad, None to keep the present one."""

    time: float
    position: Vec3
    velocity: Vec3 | None = None
    acceleration: Vec3 | None = None
    heading: float | None = None


FieldValue = str | float | bool | None
"""The type of an event's field."""


class Event(NamedTuple):
    """An event as recorded (`kybflow.core.events` declares the events). at: the mission line that
    caused it, or empty."""

    time: Time
    name: str
    vehicle: str
    fields: dict[str, FieldValue]
    at: str = ""


CENTRE = 0.05
"""An input's axis is at rest if it is no further than this from zero."""


class InputReading(NamedTuple):
    """A reading of an input that an operator steers. heard: when the device sent it or last
    reported that nothing changed. axes: each axis by name, -1 to 1. held: the names of the pressed
    buttons. engaged: whether the dead-man switch is held; true if there is none."""

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
    """A moving obstacle when it was last seen: a ball in the world frame, SI. speed: the highest
    speed of the obstacle."""

    time: Time
    position: Vec3
    velocity: Vec3
    radius: float
    speed: float


SeenObstacles = Mapping[str, SeenObstacle]
"""The moving obstacles that have been seen during the run, by name."""
NO_OBSTACLES: SeenObstacles = MappingProxyType({})


class SeenObject(NamedTuple):
    """An object of the world when it was last seen, in the world frame, SI. q, speed: the
    coordinate of its joint and its rate; for a free object the heading and its rate."""

    time: Time
    position: Vec3
    attitude: Quat
    velocity: Vec3
    q: float
    speed: float


SeenObjects = Mapping[str, SeenObject]
"""The objects that have been seen during the run, by name."""
NO_OBJECTS: SeenObjects = MappingProxyType({})


class NeighbourState(NamedTuple):
    """The state that a vehicle published to its neighbours at the end of the tick at `time`.
    estimate: its estimate. setpoint: the setpoint that it followed. said: the message that its
    behavior returned from `says`. Each is None if there is none."""

    time: Time
    estimate: Estimate | None
    setpoint: Setpoint | None
    said: Measurement | None


Answer = TypeVar("Answer")


class Neighbours(Protocol):
    """The states that the vehicles publish to each other, kept for half a second."""

    def heard(self, vehicle: str, by: Time) -> NeighbourState | None:
        """Return the newest state that the vehicle published at the time `by` or before; None if it
        has not published any."""

    def once(self, question: Hashable, answer: Callable[[], Answer]) -> Answer:
        """Return the answer to a question about the neighbours. question: the key of the question.
        answer: the function that computes it, called only for the first request in each tick."""


class _Nobody:
    def heard(self, vehicle: str, by: Time) -> NeighbourState | None:
        return None

    def once(self, question: Hashable, answer: Callable[[], Answer]) -> Answer:
        return answer()


NOBODY: Neighbours = _Nobody()


class WrongFrame(NamedTuple):
    """What motion capture and IMU disagree about. reason: what would explain it, and what to check.
    value: the difference of their accelerations, m/s^2. bound: the largest allowed one."""

    reason: str
    value: float
    bound: float


class InertialMotion(NamedTuple):
    """The motion of a vehicle by its IMU alone, in axes forward, left and up. velocity: m/s.
    acceleration: m/s^2."""

    velocity: Vec3
    acceleration: Vec3


class Tick(NamedTuple):
    """The input of a vehicle's parts in one tick.

    now: the tick's time. dt: seconds since the vehicle's last tick. elapsed: seconds since the
    behavior was entered. fleet: every vehicle's estimate by name, frozen before any behavior runs;
    None for a vehicle without one. setpoint: the one that the tracker followed in the last tick.
    imu: the newest IMU measurement, if the vehicle subscribes to it. link_age: seconds since the
    vehicle's last measurement; other messages, such as heartbeats, don't count. link_delay: the
    round-trip time to the vehicle in seconds, zero while unknown. payload: where the payload is,
    None while unknown. inputs: the readings of the mission's inputs. neighbours: what the vehicles
    have published in earlier ticks. moving: the moving obstacles. wrong_frame: why the frame of the
    poses is wrong, None while no error is known. imu_motion: the motion by the IMU alone if that
    frame is wrong; None otherwise. rejection: why the vehicle doesn't use the positions that it is
    sent, None if it does. command: the one that was sent in the last tick. uncompared: for how long
    poses have come in this flight by which their frame could not be judged, s. objects: the objects
    of the world that motion capture tracks. share: what the coordinator of the vehicle's flow gave
    it in the last tick, None without one. touches: the object that the vehicle's behavior means to
    touch, empty for none.
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
    wrong_frame: WrongFrame | None = None
    imu_motion: InertialMotion | None = None
    rejection: str | None = None
    command: Command | None = None
    uncompared: float = 0.0
    objects: SeenObjects = NO_OBJECTS
    share: float | None = None
    touches: str = ""

    @property
    def sound_estimate(self) -> Estimate | None:
        """The estimate, None if there is none or the frame of its poses is wrong."""
        return self.estimate if self.wrong_frame is None else None

    def known(self) -> Estimate:
        """Return the estimate. Raises EstimateMissing if there is none."""
        if self.estimate is None:
            raise EstimateMissing("no estimator has an estimate")
        return self.estimate
