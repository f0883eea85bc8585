"""Poses from a motion-capture system on the network, over VRPN.

Vicon Tracker, OptiTrack Motive and VRPN's own server support it. A vehicle uses the body with its
own name unless `body` names another. All vehicles share one connection to a server, which is
reopened when it is lost. The server's stamps are converted to the run's clock by the least delay
(`kybflow.core.clock_offset`), so that the two clocks need not agree. Invalid poses, as written for
a lost body, are left out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

from kybflow.core.errors import DriverError
from kybflow.core.params import param, params
from kybflow.core.signals import MeasurementKind, Pose
from kybflow.core.units import Duration
from kybflow.parts.base import Claim, Objection
from kybflow.parts.link import Link
from kybflow.parts.sensor import Sensor, Stream
from kybflow.sensors._stream import Axes, PoseStream, Units
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random
    from collections.abc import Mapping

    from kybflow.world.cameras import Camera


@params
class VrpnParams:
    host: str = param("The server, as `HOST` or `HOST:PORT`.", read_only=True)
    body: str | None = param(
        "The body's name at the server; by default the vehicle's.", default=None, read_only=True
    )
    sensor: int = param("Number of the body's sensor.", default=0, at_least=0, read_only=True)
    units: Units = param("Unit of positions.", default="m", read_only=True)
    axes: Axes = param("The server's axis that points up.", default="z_up", read_only=True)
    opening: Literal["direct", "lob"] = param(
        "Connect by TCP alone (`direct`), or request a call-back and receive datagrams (`lob`).",
        default="direct", read_only=True,
    )  # fmt: skip
    latency: Duration = param(
        "Time from the exposure to the departure of the pose from the server, which can't be "
        "measured here.",
        default=0.0, at_least=0.0, at_most=0.5, read_only=True,
    )  # fmt: skip


class Vrpn(Sensor[VrpnParams]):
    provides: ClassVar[frozenset[MeasurementKind]] = frozenset({Pose})
    tracks_bodies = True

    @classmethod
    def objection(cls, params: VrpnParams, cameras: Mapping[str, Camera]) -> Objection | None:
        from kybflow.sensors.vrpn.client import read_address

        try:
            read_address(params.host, params.opening == "direct")
        except DriverError as error:
            return Objection.of("host", error)
        return None

    @classmethod
    def claim(cls, params: VrpnParams, vehicle: str) -> Claim:
        part = f", sensor {params.sensor}," if params.sensor else ""
        return Claim("body", f"the body `{params.body or vehicle}`{part} of `{params.host}`")

    @classmethod
    def tracking(cls, params: VrpnParams, body: str) -> VrpnParams:
        return replace(params, body=body, sensor=0)

    @classmethod
    def real_time(cls, params: VrpnParams) -> bool:
        return True

    @classmethod
    def open(
        cls, params: VrpnParams, context: VehicleContext, link: Link, generator: random.Random
    ) -> Stream:
        from kybflow.sensors.vrpn.client import read_address, subscribe

        address = read_address(params.host, params.opening == "direct")
        body = context.vehicle if params.body is None else params.body
        source = subscribe(address, body, params.sensor)
        return PoseStream(source, params.units, params.axes, params.latency)
