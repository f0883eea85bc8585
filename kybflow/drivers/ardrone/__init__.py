"""Parrot AR.Drone 2.0 over Wi-Fi: AT commands out, navigation data back.

The drone takes off, lands and holds its height by itself. It follows a tilt, a climb rate and a
heading rate, each a fraction of a limit that the mission configures. It sends navigation data at
15 Hz (`demo`) or 200 Hz (`full`). A thread sends the newest command at a fixed rate. After 200 ms
without a new command it sends a hover command, and after 250 ms nothing, so that the drone's own
watchdog lands it if this program stops. Each of several drones needs its own address.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Battery, CommandKind, Imu, Odometry
from kybflow.drivers.ardrone.acts import ACTS
from kybflow.drivers.ardrone.params import ArdroneLinkParams, ArdroneParams
from kybflow.parts import Claim, Driver, Objection, Seat, Session
from kybflow.world.vehicle_context import Airframe, InnerLoop, Parcel

if TYPE_CHECKING:
    import random

TRACKER = {"use": "tilt_climb"}
CLIMB_TIME = 1.0 / 1.4
"""Time constant of the climb rate, seconds; tum_ardrone predicts the climb with 1.4 1/s (Engel,
Sturm and Cremers, IROS 2012)."""
DEAD_TIME = 0.005
BODIES = {"mass": (0.33, 0.6), "diameter": (0.3, 0.42)}
"""An AR.Drone's mass, kg, and diameter, m. Parrot's data are 380 g with the outdoor hull and 420 g
with the indoor hull; more is for a larger battery and what people fasten to it."""


class Ardrone(Driver[ArdroneParams]):
    accepts = frozenset({CommandKind.TILT_CLIMB})
    provides = frozenset({Battery, Imu, Odometry})
    acts = ACTS
    lands: ClassVar[bool] = True
    lands_blind: ClassVar[bool] = True
    preflight_timeout = 30.0
    caps: ClassVar[Mapping[str, str]] = {
        "tilt": "euler_angle_max", "climb": "control_vz_max", "height": "altitude_max",
    }  # fmt: skip
    bodies: ClassVar[Mapping[str, tuple[float, float]]] = BODIES
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {"ardrone": {}}

    @classmethod
    def tracker(cls, params: ArdroneLinkParams) -> Mapping[str, str]:
        return TRACKER

    @classmethod
    def control_rate(cls, params: ArdroneLinkParams) -> int:
        return 100

    @classmethod
    def inner_loop(cls, params: ArdroneLinkParams, airframe: Airframe) -> InnerLoop:
        """Return the airframe's loop, commanded over a radio link in which a command waits half a
        period on average."""
        late = params.latency + 0.5 / params.rate
        loop, lag = airframe.attitude_loop, airframe.rotor_time
        return InnerLoop(loop, lag, 0.0, DEAD_TIME, late, climb_time=CLIMB_TIME)

    @classmethod
    def objection(
        cls, params: ArdroneParams, start: Vec3, payload: Parcel | None
    ) -> Objection | None:
        from kybflow.drivers.ardrone.udp import is_address

        if not is_address(params.host):
            return Objection("host", f"`{params.host}` is not an IPv4 address")
        return None

    @classmethod
    def claim(cls, params: ArdroneParams, vehicle: str, number: int) -> Claim:
        return Claim("host", f"the drone at `{params.host}`")

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.ardrone.link import ArdroneSession

        return ArdroneSession(seats, generator)
