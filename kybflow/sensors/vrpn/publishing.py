"""Publishes the simulated motion capture of vehicles and moving obstacles on a VRPN server.

The published poses are those that the mission receives, including noise, latency and faults.
"""

from __future__ import annotations

import dataclasses
import random
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from kybflow.core.errors import KybflowError
from kybflow.core.geometry import LEVEL, Vec3, add, integrate
from kybflow.core.signals import Measurement, Pose, Time
from kybflow.dsl.plan import Plan
from kybflow.parts import Driver, Link, Seat, Session
from kybflow.sensors.simulated_motion_capture import (
    SimulatedBall,
    SimulatedMotionCaptureParams,
    SimulatedPoses,
)
from kybflow.sensors.vrpn.server import Server

Publish = Callable[[str, Pose], None]
"""A function that publishes the pose of a named body, stamped in the run's time."""


def to(server: Server, clock: Callable[[], Time] = time.time_ns) -> Publish:
    """Return a function that publishes on `server`. Time stamps are shifted such that the first
    pose has the current time."""
    began: list[Time] = []

    def publish(name: str, pose: Pose) -> None:
        if not began:
            began.append(clock() - pose.time)
        server.publish(name, pose.position, pose.attitude, began[0] + pose.time)

    return publish


def published(plan: Plan, publish: Publish) -> Plan:
    """Return the plan with drivers that also publish the poses of vehicles and moving obstacles as
    they arrive. Raises KybflowError if a vehicle is not simulated."""
    for vehicle in plan.vehicles:
        if not vehicle.driver.cls.simulated:
            raise KybflowError(f"`{vehicle.name}` flies on `{vehicle.driver.name}`, which is real")
    balls = _Balls(plan, publish)
    drivers: dict[Any, Any] = {
        v.driver.cls: _Published(v.driver.cls, publish, balls) for v in plan.vehicles
    }
    vehicles = (
        dataclasses.replace(
            vehicle, driver=dataclasses.replace(vehicle.driver, cls=drivers[vehicle.driver.cls])
        )
        for vehicle in plan.vehicles
    )
    return dataclasses.replace(plan, vehicles=tuple(vehicles))


class PoseNoise(NamedTuple):
    """Standard deviations of a pose's position along each axis (metres) and of its attitude about
    each axis (radians)."""

    position: float
    attitude: float


def still(
    places: Mapping[str, Vec3], publish: Publish, noise: PoseNoise, generator: random.Random
) -> Callable[[Time], None]:
    """Return a function that publishes the poses of bodies at rest at a given time. Without noise,
    clients would regard the bodies as frozen."""

    def drawn(deviation: float) -> Vec3:
        gauss = generator.gauss
        return gauss(0.0, deviation), gauss(0.0, deviation), gauss(0.0, deviation)

    def step(now: Time) -> None:
        for name, place in places.items():
            attitude = integrate(LEVEL, drawn(noise.attitude), 1.0)
            publish(name, Pose(now, add(place, drawn(noise.position)), attitude))

    return step


class _Published:
    """Wraps a driver and publishes the poses read from its links."""

    def __init__(self, driver: type[Driver[Any]], publish: Publish, balls: _Balls) -> None:
        self._driver, self._publish, self._balls = driver, publish, balls

    def __getattr__(self, name: str) -> object:
        return getattr(self._driver, name)

    def open(self, seats: Sequence[Seat], generator: random.Random) -> Session:
        session = self._driver.open(seats, generator)
        for name, link in session.links.items():
            _tap(link, name, self._publish, self._balls)
        return session


class _Balls:
    """The moving obstacles, measured by simulated motion capture."""

    def __init__(self, plan: Plan, publish: Publish) -> None:
        self._publish = publish
        self._streams = {
            ball.body or name: SimulatedBall(
                ball,
                partial(
                    SimulatedPoses,
                    SimulatedMotionCaptureParams(),
                    generator=random.Random(f"published {name}"),
                ),
            )
            for name, ball in plan.moving.items()
        }

    def step(self, now: Time) -> None:
        """Publish the poses of each obstacle that have arrived since the last call."""
        for body, stream in self._streams.items():
            for pose in stream.read(now):
                if type(pose) is Pose:
                    self._publish(body, pose)


def _tap(link: Link, name: str, publish: Publish, balls: _Balls) -> None:
    """Make `link` publish the vehicle's poses, and those of the obstacles, whenever it is read."""
    read = link.read

    def tapped(now: Time) -> Sequence[Measurement]:
        balls.step(now)
        measurements = read(now)
        for measurement in measurements:
            if type(measurement) is Pose:
                publish(name, measurement)
        return measurements

    link.read = tapped  # type: ignore[method-assign]
