"""What flows: measurements, estimates, setpoints, commands, alarms and events.

Immutable values of plain floats. Time is integer nanoseconds since the clock's zero (`Time`); every
signal that is true at some time carries it. World frame ENU, body frame FLU, SI units (REP 103).
"""

from __future__ import annotations

import re
from enum import Enum, IntEnum
from typing import Annotated, Any, Literal, NamedTuple, Protocol

from kybflow.core.errors import EstimateMissing
from kybflow.core.geometry import Quat, Vec3

Time = int
NS = 1_000_000_000
"""Nanoseconds in a second."""
NEVER: Time = 1 << 62
"""A time that does not come."""


class Measurement(Protocol):
    """Something that a sensor measured, true at `time`.

    A kind of measurement is a class: a NamedTuple of `time` and what was measured. An estimator
    `needs` kinds, a driver or a sensor `provides` them. The class alone declares a kind; it is
    admitted, counted, recorded and handed to the estimators by what stands here. In the recording
    it has a topic and a message of its name, with the comments in `Annotated`. What can be
    recorded: `Time`, `float`, `bool`, `Vec3`, `Quat`; where `Recorded` names one more field, also
    `T | None` and `tuple[float, ...]`. A `str` makes a topic of its own for each value, and `Any`
    is left out.
    """

    @property
    def time(self) -> Time: ...


MeasurementKind = type[Measurement]


def kind_name(kind: MeasurementKind) -> str:
    """The name of a kind in messages and topics: `optical_flow` for the class OpticalFlow."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


class Recorded(NamedTuple):
    """How a field is recorded for which one number is not enough. comment: what its own field in
    the message says. extra, extra_comment: the field before it, which says whether there is a
    value, or how many there are."""

    comment: str
    extra: str
    extra_comment: str


Stamp = Annotated[Time, "ns; when it was true. It arrived at the message's log time."]


class Pose(NamedTuple):
    """A pose from outside, as motion capture gives it: `time` is when it was true, not when it
    arrived."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    attitude: Quat


class Battery(NamedTuple):
    """The battery as the vehicle reports it; `remaining` is 0 to 1."""

    time: Stamp
    remaining: Annotated[float, "0 to 1"]
    voltage: Annotated[float, "V"]


class Imu(NamedTuple):
    """What the inertial sensors measured on average over the last `dt` seconds, with their biases
    and noise: specific force (m/s^2; at rest it points up with 9.81) and turn rate (rad/s), body
    frame."""

    time: Annotated[Time, "ns; the end of what it is the average of"]
    dt: Annotated[float, "s; how long that was"]
    specific_force: Annotated[Vec3, "m/s^2, body (FLU)"]
    angular_velocity: Annotated[Vec3, "rad/s, body"]


IMU_TIMEOUT: Time = NS // 10
"""An IMU that was not heard for so long tells nothing about the motion since."""


class Frame(NamedTuple):
    """What a camera saw. image: a grey array, (height, width) uint8. `time` is the middle of the
    exposure of the image's middle row, not when it arrived."""

    time: Annotated[Time, "ns; the middle of its exposure. It arrived at the message's log time."]
    camera: str
    image: Any


class Position(NamedTuple):
    """A position from outside without an attitude, as GPS gives it, in the world. spread: its
    standard deviation along each axis, metres."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    spread: Annotated[Vec3, "m, standard deviation along each axis"]


class Payload(NamedTuple):
    """What the vehicle says of its payload: whether the servo that holds it is open, and whether it
    is on board, None where the vehicle can't tell. It comes when something has changed, and so
    acknowledges that the servo moved."""

    time: Stamp
    is_open: Annotated[bool, "the servo that holds the payload"]
    aboard: Annotated[
        bool | None, Recorded("", "known", "false: the vehicle can't tell whether it is on board")
    ]


class Odometry(NamedTuple):
    """What an autopilot's own estimator believes: velocity in the world, angular_velocity in the
    body. spread: standard deviation of the position, metres, as the autopilot has it."""

    time: Stamp
    position: Annotated[Vec3, "m, world"]
    velocity: Annotated[Vec3, "m/s, world"]
    attitude: Quat
    angular_velocity: Annotated[Vec3, "rad/s, body"]
    spread: Annotated[float, "m, standard deviation of the position"]


class Sticks(NamedTuple):
    """What a person holds: the sticks of a transmitter or of a ground station, -1 to 1 (throttle 0
    to 1; roll to the right, pitch forward, yaw to the left are positive), and its switches, each
    -1 to 1."""

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
    """Where the payload is, as the vehicle acknowledged it. ABSENT: none was taken on board."""

    ABOARD = "aboard"
    RELEASED = "released"
    ABSENT = "absent"


class Estimate(NamedTuple):
    """What the vehicle believes of itself at `time`.

    position, velocity in the world; attitude body to world; angular_velocity in the body. `source`
    is the estimator's name, `age` the seconds since the newest measurement in it was true, `spread`
    its standard deviation in metres.
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
    """The state as the simulator knows it; only the recorder and the expectations may read it.
    payload: where the centre of the payload is, on board or not; None without one."""

    position: Vec3
    velocity: Vec3
    attitude: Quat
    angular_velocity: Vec3
    payload: Vec3 | None = None


class SetpointKind(Enum):
    """What a setpoint asks the tracker to follow. IDLE asks for rotors at rest, on the ground."""

    IDLE = "idle"
    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"


class Setpoint(NamedTuple):
    """Where the vehicle should be now, and how it should move.

    The kind says which field is followed: POSITION has all of position, velocity and acceleration
    (feed-forward, zero when at rest) and jerk; VELOCITY has no position; ACCELERATION has neither.
    `heading` or `heading_rate` is held.
    """

    kind: SetpointKind
    position: Vec3 | None = None
    velocity: Vec3 | None = None
    acceleration: Vec3 | None = None
    jerk: Vec3 | None = None
    heading: float | None = None
    heading_rate: float = 0.0


class CommandKind(Enum):
    """What a tracker gives and a driver accepts: what the vehicle's own controller is to follow."""

    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    ATTITUDE_THRUST = "attitude_thrust"
    RATES_THRUST = "rates_thrust"


class Command(NamedTuple):
    """What the on-board controller is to follow; `kind` says what of it counts.

    ATTITUDE_THRUST: `attitude`, body to world, `thrust`, newtons along body z, and `rates`, body
    rates to feed forward. RATES_THRUST: `rates` and `thrust`. POSITION, VELOCITY and ACCELERATION:
    `setpoint`, which has at least what the kind says; what else it has is fed forward. `armed`
    false stops the rotors. heading: what the sender believes the heading to be now, for an on-board
    filter that can't see it (an autopilot takes it from external vision in the same way); None when
    nobody knows: then the heading in `attitude` means nothing, and the on-board controller holds
    the one that it has.
    """

    attitude: Quat
    thrust: float
    rates: Vec3
    heading: float | None
    armed: bool = True
    kind: CommandKind = CommandKind.ATTITUDE_THRUST
    setpoint: Setpoint | None = None


class Reaction(IntEnum):
    """What the failsafe does, in order of severity; the severest of a tick wins."""

    WARN = 1
    BRAKE = 2
    GO_HOME = 3
    LAND = 4
    LAND_BLIND = 5
    CUT = 6


ReactionName = Literal["warn", "brake", "go_home", "land", "land_blind", "cut"]
"""A reaction as a mission chooses it for a supervisor."""


class Alarm(NamedTuple):
    """A bound that was crossed: an event's name (past tense), what to do, why, the measured value
    and the bound; None where there is no number."""

    event: str
    reaction: Reaction
    reason: str
    value: float | None = None
    bound: float | None = None


class Done(NamedTuple):
    """A behavior's last update: it ended as it should, and this setpoint still counts."""

    setpoint: Setpoint


class Failed(NamedTuple):
    """A behavior's last update: it could not do its work, and why; the setpoint still counts."""

    setpoint: Setpoint
    reason: str


class Grip(NamedTuple):
    """A behavior's update that also asks for the servo that holds the payload, open or closed; the
    setpoint counts as ever. Ask until the vehicle has acknowledged it."""

    setpoint: Setpoint
    is_open: bool


class Event(NamedTuple):
    """Something that happened. `name` is in the past tense; `at` is the mission line that caused
    it, or empty."""

    time: Time
    name: str
    vehicle: str
    fields: dict[str, str | float | bool | None]
    at: str = ""


class Tick(NamedTuple):
    """What a vehicle's parts see in one tick.

    now: the tick's time. dt: seconds since the vehicle's last tick. elapsed: seconds since the
    behavior was entered.
    fleet: the frozen estimates of every vehicle (None for a vehicle without one), by name.
    setpoint: what the tracker followed in the last tick. imu: the newest one, where the vehicle
    subscribes to it. link_age: seconds since the link delivered anything. payload: where it is,
    None while nobody knows.
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
    payload: PayloadState | None = None

    def known(self) -> Estimate:
        """The estimate; raises EstimateMissing where there is none."""
        if self.estimate is None:
            raise EstimateMissing("no estimator has an estimate")
        return self.estimate
