"""How a vehicle differs from its airframe, and the disturbances of its lab, drawn once per
flight."""

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

ROTOR_SPREAD = 0.2
"""Largest difference of a rotor's thrust from the mean, as a fraction of `model_error`."""
ACROSS = 0.6
"""The accelerometer's vibration along body x and y, relative to that along z."""


class Lab(NamedTuple):
    """The lab of one vehicle. drag: factor on the body's drag. inflow: drag along body z relative
    to that in the rotors' plane. loop: settings of the on-board loop. eddies: force (N, world
    frame) and torque (N m, body frame); None in still air. vibration: of the IMU in hover; None
    without vibration. ground, downwash: the models of both effects; None without. markers: attitude
    of the motion-capture body relative to the vehicle's. stamps: error of the poses' time stamps,
    s. late: delay of each command, s; None without delay."""

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
    def disturbs(self) -> bool:
        """Whether any disturbance changes over time."""
        found = (self.eddies, self.vibration, self.ground, self.downwash)
        return any(disturbs is not None for disturbs in found)


def as_flown(params: Any) -> Any:
    """Return the parameters, with all disturbances set to zero if `calm`."""
    return replace(params, **_NOUGHT) if params.calm else params


def lab(p: Any, airframe: Airframe, body: BuiltAirframe, generator: Any) -> Lab:
    """Draw the random lab of a vehicle. p: the vehicle's parameters from `as_flown`. body: the
    vehicle as built."""
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


def build(airframe: Airframe, error: float, generator: Any) -> BuiltAirframe:
    """Draw a random vehicle that differs from its airframe by at most the fraction `error`; its
    rotors differ a little from each other. The inertia follows from the mass distribution drawn
    along each axis, since three independently drawn moments may be physically impossible."""
    draws = (1.0 + error * generator.uniform(-1.0, 1.0, 7)).tolist()
    mass, along_x, along_y, along_z, thrust, rotor_time, drag = draws
    half = sum(airframe.inertia) / 2.0
    xx, yy, zz = (
        max(0.0, half - moment) * factor
        for moment, factor in zip(airframe.inertia, (along_x, along_y, along_z), strict=True)
    )
    spread = 1.0 + error * ROTOR_SPREAD * generator.uniform(-1.0, 1.0, 4)
    a, b, c, d = (airframe.thrust * thrust * spread).tolist()
    return BuiltAirframe(
        airframe.mass * mass, (yy + zz, zz + xx, xx + yy), (a, b, c, d),
        airframe.rotor_time * rotor_time, airframe.drag * drag,
    )  # fmt: skip
