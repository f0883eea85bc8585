"""The observables of conditions and expectations.

The compiler uses an observable's type; the runtime calls its getter. `View.state` is the estimate
in a condition, and the simulator's truth in an expectation if there is one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from operator import attrgetter
from typing import NamedTuple, Protocol

from kybflow.core.geometry import Quat, Vec3, distance, heading_of, norm, tilt_of
from kybflow.core.signals import Battery, PayloadState, Setpoint, Sticks
from kybflow.core.units import (
    ANGLE,
    ANGULAR_RATE,
    DURATION,
    LENGTH,
    NUMBER,
    RATIO,
    SPEED,
    VOLTAGE,
    Dimension,
)
from kybflow.world.objects import SlideJoint, TurnJoint, WorldObject


class Unavailable(Exception):
    """Raised if a value, such as the estimate, is unknown now. A comparison with it is then
    false."""


def chains_of(state: str) -> tuple[str, ...]:
    """Return the chains that contain a state, outermost first: `a` and `a.b` for `a.b.c`."""
    if "." not in state:
        return ()
    return tuple(state[:i] for i, letter in enumerate(state) if letter == ".")


def is_in(behavior: str, state: str) -> bool:
    """Return whether a vehicle in the state `behavior` is in `state`, which may be a chain that
    contains it."""
    return behavior == state or ("." in behavior and behavior.startswith(f"{state}."))


NOTHING = "nothing"
"""What a vehicle touches that touches no object."""


class State(Protocol):
    """The properties that an Estimate and a Truth have in common."""

    @property
    def position(self) -> Vec3:
        """The position in the world frame, metres."""

    @property
    def velocity(self) -> Vec3:
        """The velocity in the world frame, m/s."""

    @property
    def attitude(self) -> Quat:
        """The attitude, body to world."""


class ObstacleView(Protocol):
    def distance(self, p: Vec3) -> float:
        """Return the distance from the surface to `p`, metres; negative inside."""


class ObjectView(State, Protocol):
    """The properties of an object that is seen or simulated. q, speed: the coordinate of its joint
    and its rate; for a free object the heading and its rate."""

    @property
    def q(self) -> float: ...

    @property
    def speed(self) -> float: ...


class View(Protocol):
    """The values of one vehicle that observables read. A property raises Unavailable while its
    value is unknown."""

    @property
    def state(self) -> State:
        """The estimate in a condition; the simulator's truth, if any, in an expectation."""

    @property
    def wanted(self) -> Setpoint:
        """The setpoint that the behavior requests, before processors change it; Unavailable on the
        ground."""

    @property
    def battery(self) -> Battery:
        """The newest battery report."""

    @property
    def behavior(self) -> str:
        """The name of the active state; empty before the first."""

    @property
    def estimator(self) -> str:
        """The name of the estimator in use."""

    @property
    def elapsed(self) -> float:
        """Seconds since the active state was entered."""

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground and its rotors turn."""

    @property
    def start(self) -> Vec3:
        """The vehicle's declared start in the world frame, metres."""

    @property
    def age(self) -> float:
        """The estimate's age, seconds."""

    @property
    def spread(self) -> float:
        """The standard deviation of the estimate's position, metres."""

    @property
    def payload(self) -> PayloadState:
        """The state of the payload, as the vehicle acknowledged it."""

    @property
    def payload_place(self) -> Vec3:
        """The position of the payload's centre in the world frame, metres; Unavailable outside a
        simulator."""

    @property
    def hull(self) -> float:
        """The distance from the vehicle's centre to the tips of its rotors, metres."""

    def obstacle(self, name: str) -> ObstacleView:
        """Return where an obstacle is: in a condition, a moving one is believed to be where it was
        seen last, and grows until it is seen again; in an expectation, it is where the simulator
        has it, if there is one. Unavailable before the obstacle was seen."""

    @property
    def contact(self) -> str:
        """The object that the vehicle touches, or `nothing`: in a condition, as inferred from poses
        and tilt; in an expectation, the simulator's contacts, if any."""

    @property
    def contact_time(self) -> float:
        """For how long it has touched that object, s; 0 without contact."""

    def object(self, name: str) -> ObjectView:
        """Return the state of an object of the world: in a condition, as motion capture has seen
        it; in an expectation, the simulator's truth, if any. Unavailable while it is not seen."""

    def object_place(self, name: str, surface: str) -> Vec3:
        """Return the centre of an object, or of its surface, in the world frame, metres."""

    @property
    def releases(self) -> int:
        """How often the payload has been released."""

    @property
    def sticks(self) -> Sticks:
        """The pilot's sticks; Unavailable without a transmitter or a ground station."""


class Envelope(NamedTuple):
    """Bounds on the values that a vehicle can reach, in SI units and the world frame. start: its
    position on the ground. low, high: bounds of its position. speed: bound of its speed. tilt:
    bound of its tilt. error, velocity_error: bounds of the differences between its state and its
    setpoint. age: bound of the estimate's age. spread: the least standard deviation of the
    estimated position, with the best sensors."""

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
    of a state or an estimator), which is compared with `==` and `!=`. low, high: bounds that hold
    for every vehicle, SI. words: all possible values of a text, if they are fixed. reach: returns
    the bounds for a vehicle within an envelope; None if these don't differ from `low` and
    `high`. wraps: whether it is a direction, which jumps from `high` to `low`. aloft: whether it is
    known only in the air."""

    help: str
    dimension: Dimension | None
    read: Callable[[View], float | str]
    low: float = -inf
    high: float = inf
    words: tuple[str, ...] = ()
    reach: Callable[[Envelope], tuple[float, float]] | None = None
    wraps: bool = False
    aloft: bool = False

    def bounds(self, envelope: Envelope | None) -> tuple[float, float]:
        """Return the range that the value never leaves, for a vehicle within `envelope` if it is
        given."""
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
        "Heading from east.", ANGLE, lambda v: heading_of(v.state.attitude), -pi, pi,
        wraps=True,
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
        "Distance from the behavior's setpoint, in the air.", LENGTH, _position_error, low=0.0,
        reach=lambda e: (0.0, e.error), aloft=True,
    ),
    "velocity_error": Observable(
        "Norm of the velocity's deviation from the behavior's setpoint, in the air.",
        SPEED,
        _velocity_error,
        low=0.0,
        reach=lambda e: (0.0, e.velocity_error),
        aloft=True,
    ),
    "elapsed": Observable("Time in the present behavior.", DURATION, lambda v: v.elapsed, low=0.0),
    "behavior": Observable("Name of the present state.", None, lambda v: v.behavior),
    "estimator": Observable("Name of the estimator in use.", None, lambda v: v.estimator),
    "contact": Observable(
        "Name of the object that the vehicle touches with its bumper, or `nothing`.", None,
        lambda v: v.contact,
    ),
    "contact.time": Observable(
        "For how long it has touched that object; 0 s without contact.", DURATION,
        lambda v: v.contact_time, low=0.0,
    ),
    "payload": Observable(
        "State of the payload that the vehicle has acknowledged.",
        None,
        lambda v: v.payload.value,
        words=tuple(state.value for state in PayloadState),
    ),
    "payload.releases": Observable(
        "Number of releases.", NUMBER, lambda v: float(v.releases), low=0.0
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


@dataclass(frozen=True, slots=True)
class ObjectObservable:
    """A value of an object that conditions and expectations can read by name. has: returns whether
    an object has it. low, high, wraps: as in `Observable`. of_joint: whether it is the coordinate
    of the object's joint."""

    help: str
    dimension: Dimension
    read: Callable[[ObjectView], float]
    has: Callable[[WorldObject], bool] = lambda _: True
    low: float = -inf
    high: float = inf
    wraps: bool = False
    of_joint: bool = False


OBJECT_OBSERVABLES: dict[str, ObjectObservable] = {
    "x": ObjectObservable("Position of its centre east.", LENGTH, lambda o: o.position[0]),
    "y": ObjectObservable("Position of its centre north.", LENGTH, lambda o: o.position[1]),
    "z": ObjectObservable("Height of its centre.", LENGTH, lambda o: o.position[2]),
    "yaw": ObjectObservable(
        "Heading of its x axis.", ANGLE, lambda o: heading_of(o.attitude), low=-pi, high=pi,
        wraps=True,
    ),
    "speed": ObjectObservable(
        "Speed of its centre.", SPEED, lambda o: norm(o.velocity), low=0.0
    ),
    "position": ObjectObservable(
        "Position along its slide, from `at`.", LENGTH, lambda o: o.q,
        lambda one: isinstance(one.joint, SlideJoint), of_joint=True,
    ),
    "angle": ObjectObservable(
        "Angle of its joint.", ANGLE, lambda o: o.q,
        lambda one: isinstance(one.joint, TurnJoint), of_joint=True,
    ),
    "turn_rate": ObjectObservable(
        "Rate of turning, about its joint or, of a free object, about the vertical.",
        ANGULAR_RATE, lambda o: o.speed,
        lambda one: one.is_free or isinstance(one.joint, TurnJoint),
    ),
}  # fmt: skip
