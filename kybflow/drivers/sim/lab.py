"""How a vehicle in a lab differs from what its maker says, and what its lab does to it; drawn once
a flight. A calm world has none of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from kybflow.core.geometry import LEVEL, Quat, integrate
from kybflow.drivers.sim.air import EDDY_TIME, Downwash, GroundEffect, Wandering
from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.sensors import Array, bias, draw, vibrations
from kybflow.drivers.sim.steps.onboard import Loop
from kybflow.world.vehicle_context import Airframe

_NOUGHT = dict.fromkeys(
    (
        "force_noise", "torque_noise", "drag_error", "accelerometer_vibration", "gyro_vibration",
        "ground_effect", "downwash", "inflow", "loop_error", "gyro_filter", "dead_time",
        "command_latency", "command_jitter", "mocap_misalignment", "mocap_loss", "stamp_error",
        "stamp_jitter",
    ),
    0.0,
)  # fmt: skip

ACROSS = 0.6
"""The accelerometer's vibration along body x and y over that along z."""


class Lab(NamedTuple):
    """drag: the body's over what it would be. inflow: drag along body z over that. loop: what the
    on-board loop is made of. eddies: what pushes the body, N, world frame, and turns it, N m, body
    frame; None in still air. vibration: what the IMU measures of the rotors in hover; None where
    nothing vibrates. ground, downwash: what the floor does to its thrust, and the jet below it;
    None for nothing. markers: the body that motion capture takes for the vehicle's, in the
    vehicle's. stamps: how much later than it was a pose is stamped, s. late: seconds by which each
    command is late; None where none is."""

    drag: float
    inflow: float
    loop: Loop
    eddies: Wandering | None
    vibration: Iterator[Array] | None
    ground: GroundEffect | None
    downwash: Downwash | None
    markers: Quat
    stamps: float
    late: Iterator[list[float]] | None

    @property
    def stirs(self) -> bool:
        """Whether something of it changes from tick to tick."""
        found = (self.eddies, self.vibration, self.ground, self.downwash)
        return any(stirs is not None for stirs in found)


def as_flown(params: Any) -> Any:
    """A simulated vehicle's parameters, without all that a calm world doesn't have."""
    return replace(params, **_NOUGHT) if params.calm else params


def lab(p: Any, airframe: Airframe, body: BuiltAirframe, generator: Any) -> Lab:
    """Draw a vehicle's. p: its parameters, as flown."""
    drag, jx, jy, jz, lag, stamps = generator.uniform(-1.0, 1.0, 6).tolist()
    wrong, (ix, iy, iz) = p.loop_error, airframe.inertia
    believed = replace(
        airframe,
        inertia=(ix * (1.0 + wrong * jx), iy * (1.0 + wrong * jy), iz * (1.0 + wrong * jz)),
        rotor_time=airframe.rotor_time * (1.0 + wrong * lag),
    )
    turned = bias(generator, p.mocap_misalignment)
    eddies, commands, rotors = generator.spawn(3)
    spread = [body.mass * p.force_noise] * 3 + [j * p.torque_noise for j in body.inertia]
    noise = draw(eddies, [0.0] * 6, [1.0] * 6)
    gyro, along = p.gyro_vibration, p.accelerometer_vibration
    shaking = [gyro, gyro, gyro, ACROSS * along, ACROSS * along, along]
    latency, jitter = p.command_latency, p.command_jitter
    return Lab(
        1.0 + p.drag_error * drag,
        p.inflow,
        Loop(believed, p.gyro_filter, p.dead_time),
        Wandering(spread, EDDY_TIME, noise) if any(spread) else None,
        vibrations(rotors, shaking) if any(shaking) else None,
        GroundEffect(airframe, p.ground_effect) if p.ground_effect else None,
        Downwash(airframe, p.downwash) if p.downwash else None,
        integrate(LEVEL, turned, 1.0),
        p.stamp_error * stamps,
        draw(commands, [latency], [jitter]) if latency or jitter else None,
    )
