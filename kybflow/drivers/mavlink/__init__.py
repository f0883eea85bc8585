"""PX4 and ArduPilot autopilots over MAVLink.

One driver serves both firmwares; a profile (`autopilot`) holds their differences. Several vehicles
may share a link, each with its own system id. With `position: outside` the autopilot receives
kybflow's estimate as external vision, and accelerations from kybflow's position loop, which it
follows with its own attitude controller. With its own position (GPS), or at a low setpoint rate, it
follows position setpoints instead. Everything is sent in the engine's tick: if this program stops,
setpoints and heartbeats stop too. The last setpoint then stays in force until the autopilot's own
failsafe acts; the preflight has checked that failsafe.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.errors import DriverError
from kybflow.core.geometry import Vec3
from kybflow.core.signals import Battery, CommandKind, Imu, Odometry, Payload, Position, Sticks
from kybflow.drivers import firmware_names
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.params import THRUSTS, AutopilotLinkParams, MavlinkParams
from kybflow.parts import Claim, Driver, Objection, Seat, Session
from kybflow.world.vehicle_context import Airframe, InnerLoop, Parcel, attitude_loop

if TYPE_CHECKING:
    import random

ACCELERATION_RATE_HZ = 40.0
"""The lowest setpoint rate, Hz, at which kybflow's position loop may send accelerations."""
SLOW_CONTROL_HZ, QUICK_CONTROL_HZ = 100, 250
"""Control rates, Hz: SLOW_CONTROL_HZ if it allows two ticks per setpoint, otherwise
QUICK_CONTROL_HZ. The attitude loop, which needs a higher rate, runs on the autopilot."""
DEAD_TIME_S, LINK_S = 0.005, 0.01
"""Delays in seconds: from the autopilot's gyroscope to its rotors, and from this program to the
autopilot."""


class Mavlink(Driver[MavlinkParams]):
    """The driver; it imports pymavlink only when it is opened."""

    accepts = frozenset(CommandKind) - {CommandKind.TILT_CLIMB}
    provides = frozenset(
        {
            Battery, Imu, Odometry,
            Position, Payload, Sticks,
        }
    )  # fmt: skip
    lands: ClassVar[bool] = True
    lands_blind: ClassVar[bool] = True
    grips: ClassVar[bool] = True
    streams_imu = True
    brings = ("simulated_camera", "simulated_motion_capture")
    preflight_timeout = 60.0
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {
        name: {"autopilot": name, "simulator": True} for name in firmware_names("mavlink")
    }

    @classmethod
    def takes(cls, params: MavlinkParams) -> frozenset[CommandKind]:
        """Return the accepted command kinds. Those with a thrust need `attitude`, because they are
        not tested well enough. The failsafe's landing by IMU sends them regardless."""
        return cls.accepts if params.attitude else cls.accepts - THRUSTS

    @classmethod
    def tracker(cls, params: AutopilotLinkParams) -> Mapping[str, str]:
        """Return the default tracker: by acceleration if kybflow provides the position and sends
        setpoints often enough, otherwise by position."""
        if params.position != "outside" or params.rate < ACCELERATION_RATE_HZ:
            return {"use": "on_board", "by": "position"}
        keeps = "true" if profile_of(params.autopilot).keeps_height else "false"
        return {"use": "on_board", "by": "acceleration", "keeps_height": keeps}

    @classmethod
    def control_rate(cls, params: AutopilotLinkParams) -> int:
        return SLOW_CONTROL_HZ if 2 * params.rate <= SLOW_CONTROL_HZ else QUICK_CONTROL_HZ

    @classmethod
    def inner_loop(cls, params: MavlinkParams, airframe: Airframe) -> InnerLoop:
        """Return the firmware's default loop, with the airframe's own gains if it has any."""
        profile, lag = profile_of(params.autopilot), airframe.rotor_time
        gain = airframe.attitude_gain or profile.attitude_gain
        loop = attitude_loop(lag, gain, airframe.rate_gain)
        return InnerLoop(loop, lag, profile.gyro_filter, DEAD_TIME_S, LINK_S + 0.5 / params.rate)

    @classmethod
    def shows(cls, params: MavlinkParams) -> bool:
        return params.simulator

    @classmethod
    def objection(
        cls, params: MavlinkParams, start: Vec3, payload: Parcel | None
    ) -> Objection | None:
        from kybflow.drivers.mavlink.transport.wire import read_address

        try:
            if params.address is not None:
                read_address(params.address)
        except DriverError as error:
            return Objection.of("address", error)
        return None

    @classmethod
    def claim(cls, params: MavlinkParams, vehicle: str, number: int) -> Claim:
        system = params.system or number
        address = params.address or profile_of(params.autopilot).default_address(system)
        return Claim("system", f"the system id {system} at `{address}`")

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.mavlink.link import open_session

        return open_session(seats)
