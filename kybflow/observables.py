"""What conditions and expectations may ask of a vehicle: each name, its type and how it is read,
written once.

The compiler reads the types, the runtime the getters. In a condition `view.state` is the estimate;
in an expectation it is the truth where a simulator knows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from kybflow.geometry import Quat, Vec3, distance, heading_of, norm, tilt_of
from kybflow.signals import Battery, Setpoint
from kybflow.units import ANGLE, DURATION, LENGTH, RATIO, SPEED, VOLTAGE, Dimension


class Unavailable(Exception):
    """The value can't be known now (no estimate yet, no battery report): a comparison with it is
    false."""


class State(Protocol):
    """Position and velocity in the world, attitude body to world: an Estimate or a Truth."""

    @property
    def position(self) -> Vec3: ...
    @property
    def velocity(self) -> Vec3: ...
    @property
    def attitude(self) -> Quat: ...


class View(Protocol):
    """What may be looked at of one vehicle; a property that can't be known raises Unavailable."""

    @property
    def state(self) -> State: ...
    @property
    def wanted(self) -> Setpoint:
        """The setpoint before tracking; Unavailable on the ground."""

    @property
    def battery(self) -> Battery: ...
    @property
    def behavior(self) -> str: ...
    @property
    def estimator(self) -> str: ...
    @property
    def elapsed(self) -> float: ...
    @property
    def start(self) -> Vec3: ...
    @property
    def age(self) -> float: ...
    @property
    def spread(self) -> float: ...


@dataclass(frozen=True, slots=True)
class Observable:
    """One name. `dimension` None: a name (of a state, of an estimator), compared with `==` and
    `!=`."""

    help: str
    dimension: Dimension | None
    read: Callable[[View], float | str]


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
        "Height above the world's zero.", LENGTH, lambda v: v.state.position[2]
    ),
    "state.x": Observable("Position east.", LENGTH, lambda v: v.state.position[0]),
    "state.y": Observable("Position north.", LENGTH, lambda v: v.state.position[1]),
    "state.speed": Observable("Norm of the velocity.", SPEED, lambda v: norm(v.state.velocity)),
    "state.climb": Observable("Vertical speed, up.", SPEED, lambda v: v.state.velocity[2]),
    "state.tilt": Observable(
        "Angle between body z and world z.", ANGLE, lambda v: tilt_of(v.state.attitude)
    ),
    "state.heading": Observable(
        "Heading from east.", ANGLE, lambda v: heading_of(v.state.attitude)
    ),
    "battery.remaining": Observable(
        "Charge left, 0 to 100 %.", RATIO, lambda v: v.battery.remaining
    ),
    "battery.voltage": Observable("Voltage of the battery.", VOLTAGE, lambda v: v.battery.voltage),
    "estimate.age": Observable(
        "Age of the newest measurement in the estimate.", DURATION, lambda v: v.age
    ),
    "estimate.spread": Observable(
        "Standard deviation of the position.", LENGTH, lambda v: v.spread
    ),
    "position_error": Observable(
        "Distance from the setpoint before tracking.", LENGTH, _position_error
    ),
    "velocity_error": Observable(
        "Norm of the velocity's difference from the setpoint's.", SPEED, _velocity_error
    ),
    "elapsed": Observable("Time in the present behavior.", DURATION, lambda v: v.elapsed),
    "behavior": Observable("Name of the present state.", None, lambda v: v.behavior),
    "estimator": Observable("Name of the estimator in use.", None, lambda v: v.estimator),
}

EVENTS: dict[str, str] = {
    "run_started": "The run begins.",
    "run_ended": "The run is over.",
    "observer_failed": "Something that looks on was left out, because it raised.",
    "preflight_passed": "A check before take-off is green.",
    "preflight_failed": "A check before take-off stayed red.",
    "behavior_started": "A behavior was entered.",
    "behavior_ended": "A behavior was left.",
    "behavior_failed": "A behavior failed.",
    "took_off": "The vehicle is in the air.",
    "landed": "The vehicle is on the ground again.",
    "estimator_changed": "Another estimator is in use.",
    "estimate_lost": "No estimator can be used.",
    "part_failed": "A part raised, or could not be made.",
    "failsafe_started": "The failsafe takes over.",
    "option_changed": "A parameter has another value.",
    "option_refused": "A parameter can't have the value.",
}
"""What the engine tells, by name; parts declare the events of their alarms themselves."""
OF_THE_RUN = frozenset({"run_started", "run_ended", "observer_failed"})
"""The events that belong to no vehicle."""
