"""Poses from a motion-capture system on the network, over VRPN.

Vicon Tracker, OptiTrack Motive and VRPN's own server speak it. Every vehicle takes the body that
has its name unless `body` says otherwise; all share one link to a server, which opens itself again
when it was lost. Poses carry the server's stamps, put on the run's clock by the least delay seen
(`kybflow.core.clock_offset`), so the two clocks need not agree, only go on. What no pose is, as
written for a body that is lost, is left out.
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
        "The body's name at the server; the vehicle's by default.", default=None, read_only=True
    )
    sensor: int = param("The number of the body's sensor.", default=0, at_least=0, read_only=True)
    units: Units = param("What the server measures in.", default="m", read_only=True)
    axes: Axes = param("Which of the server's axes points up.", default="z_up", read_only=True)
    opening: Literal["direct", "lob"] = param(
        "Connect by TCP alone, or ask to be called back and take datagrams.",
        default="direct", read_only=True,
    )  # fmt: skip
    latency: Duration = param(
        "From the exposure to the server's stamp and out of its door, which nobody can see here.",
        default=0.0, at_least=0.0, at_most=0.5, read_only=True,
    )  # fmt: skip


class Vrpn(Sensor[VrpnParams]):
    provides: ClassVar[frozenset[MeasurementKind]] = frozenset({Pose})
    tracks_bodies = True

    @classmethod
    def objection(cls, params: VrpnParams, cameras: Mapping[str, Camera]) -> Objection | None:
        from kybflow.sensors.vrpn.link import read_address

        try:
            read_address(params.host, params.opening == "direct")
        except DriverError as error:
            return Objection("host", str(error))
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
        from kybflow.sensors.vrpn.client import subscribe
        from kybflow.sensors.vrpn.link import read_address

        address = read_address(params.host, params.opening == "direct")
        body = context.vehicle if params.body is None else params.body
        source = subscribe(address, body, params.sensor)
        return PoseStream(source, params.units, params.axes, params.latency)
