"""Poses from a Vicon, OptiTrack or Qualisys system by its own protocol, through libmotioncapture.

Requires the package `motioncapture` (`pip install kybflow[mocap]`). The library provides no time
stamps, so a pose is stamped `latency` before its arrival. If the system also supports VRPN (Vicon
Tracker, Motive), prefer the sensor `vrpn`. A vehicle uses the body with its own name unless `body`
names another.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

from kybflow.core.params import param, params
from kybflow.core.signals import MeasurementKind, Pose
from kybflow.core.units import Duration
from kybflow.parts.base import Claim
from kybflow.parts.link import Link
from kybflow.parts.sensor import Sensor, Stream
from kybflow.sensors._stream import Axes, PoseStream, Units
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random


@params
class MotionCaptureSensorParams:
    system: Literal["vicon", "optitrack", "qualisys"] = param("Make of the system.", read_only=True)
    host: str = param("Address of its server.", read_only=True)
    body: str | None = param(
        "The body's name in the system; by default the vehicle's.", default=None, read_only=True
    )
    interface: str | None = param(
        "This computer's address in the cameras' network, if it has several (OptiTrack).",
        default=None, read_only=True,
    )  # fmt: skip
    units: Units = param(
        "Unit of positions; the library converts Vicon's and Qualisys' to metres.",
        default="m", read_only=True,
    )  # fmt: skip
    axes: Axes = param("The axis that points up.", default="z_up", read_only=True)
    latency: Duration = param(
        "Time from the exposure to the arrival.",
        default=0.01, at_least=0.0, at_most=0.5, read_only=True,
    )  # fmt: skip


class MotionCaptureSensor(Sensor[MotionCaptureSensorParams]):
    provides: ClassVar[frozenset[MeasurementKind]] = frozenset({Pose})
    tracks_bodies = True
    packages = ("motioncapture",)

    @classmethod
    def claim(cls, params: MotionCaptureSensorParams, vehicle: str) -> Claim:
        return Claim("body", f"the body `{params.body or vehicle}` of `{params.host}`")

    @classmethod
    def tracking(cls, params: MotionCaptureSensorParams, body: str) -> MotionCaptureSensorParams:
        return replace(params, body=body)

    @classmethod
    def real_time(cls, params: MotionCaptureSensorParams) -> bool:
        return True

    @classmethod
    def open(
        cls,
        params: MotionCaptureSensorParams,
        context: VehicleContext,
        link: Link,
        generator: random.Random,
    ) -> Stream:
        from kybflow.sensors.motion_capture.feed import subscribe

        settings = {"hostname": params.host}
        if params.interface is not None:
            settings["interface_ip"] = params.interface
        body = context.vehicle if params.body is None else params.body
        source = subscribe(params.system, settings, body)
        return PoseStream(source, params.units, params.axes, params.latency)
