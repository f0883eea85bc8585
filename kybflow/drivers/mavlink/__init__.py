"""PX4 and ArduPilot autopilots over MAVLink.

One part for both: what differs is a profile (`autopilot`). Several vehicles share a link and are
told apart by their system id. Unless its `position` is its own, what kybflow estimates goes to the
autopilot as external vision, and kybflow's own position loop sends it accelerations, which it
follows by its own attitude controller; by GPS, or where set-points are rare, it follows positions.
Everything goes by the engine's tick: when this program stops, so do set-points and heartbeats. The
last set-point stays in force until the autopilot's own failsafe acts, which the preflight has
looked at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Literal

from kybflow.core.errors import DriverError
from kybflow.core.signals import CommandKind, MeasurementKind
from kybflow.core.units import Duration, Frequency
from kybflow.parts import Driver, Objection, Seat, Session, param, params

if TYPE_CHECKING:
    import random

Autopilot = Literal["px4", "ardupilot"]
OFTEN = 40.0
"""Set-points a second from which on the position loop may be ours, as accelerations."""
SLOW, QUICK = 100, 250
"""Ticks a second, for set-points of position or acceleration: up to one in two ticks of the former,
and above. The attitude loop, which needs more, is the autopilot's."""


@params
class AutopilotParams:
    """What is asked of every autopilot, also of an emulated one."""

    autopilot: Autopilot = param("Whose firmware it is.", read_only=True)
    position: Literal["outside", "own"] = param(
        "Where the autopilot's position comes from: `outside`, sent by kybflow, or its `own`, as"
        " from GPS.",
        default="outside", read_only=True,
    )  # fmt: skip
    rate: Frequency = param(
        "Set-points a second.", default=50.0, at_least=5.0, at_most=250.0, read_only=True
    )
    vision_rate: Frequency = param(
        "Poses a second that are sent to it.",
        default=30.0, at_least=3.0, at_most=120.0, read_only=True,
    )  # fmt: skip
    after_failsafe: Literal["land", "resume"] = param(
        "What happens when its own failsafe had it and the link is well again: it is landed, or"
        " goes on with what it did. A vehicle that a person took is never taken back unasked.",
        default="land", read_only=True,
    )  # fmt: skip


@params
class MavlinkParams(AutopilotParams):
    address: str | None = param(
        "Where it is: `udpin:HOST:PORT`, `udpout:HOST:PORT`, `tcp:HOST:PORT` or"
        " `serial:DEVICE:BAUD`; where the firmware's own simulator is by default.",
        default=None, read_only=True,
    )  # fmt: skip
    system: int | None = param(
        "Its system id; its place among the mission's vehicles, from 1, by default.",
        default=None, at_least=1, at_most=254, read_only=True,
    )  # fmt: skip
    own_system: int = param(
        "The system id of this program.", default=245, at_least=1, at_most=255, read_only=True
    )
    simulator: bool = param(
        "Whether it is the firmware's own simulator, whose ground truth simulated sensors may"
        " watch.",
        default=False, read_only=True,
    )  # fmt: skip
    key: str | None = param(
        "File with the secret of signed messages: 32 bytes, or a passphrase. Unsigned ones are"
        " dropped then.",
        default=None, read_only=True,
    )  # fmt: skip
    lead: Duration | None = param(
        "By how much the autopilot comes after its set-points, so that they are sent ahead; by"
        " default as seen of its own simulator.",
        default=None, at_least=0.0, at_most=1.0, read_only=True,
    )  # fmt: skip
    arming_time: Duration = param(
        "How long arming may take.", default=15.0, above=0.0, read_only=True
    )


class Mavlink(Driver[MavlinkParams]):
    """pymavlink is imported when it is opened."""

    accepts = frozenset(CommandKind)
    provides = frozenset(
        {
            MeasurementKind.BATTERY, MeasurementKind.IMU, MeasurementKind.ODOMETRY,
            MeasurementKind.POSITION, MeasurementKind.PAYLOAD, MeasurementKind.STICKS,
        }
    )  # fmt: skip
    lands: ClassVar[bool] = True
    lands_blind: ClassVar[bool] = True
    grips: ClassVar[bool] = True
    brings = ("simulated_camera", "simulated_motion_capture")
    patience = 60.0
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {
        "px4": {"autopilot": "px4", "simulator": True},
        "ardupilot": {"autopilot": "ardupilot", "simulator": True},
    }

    @classmethod
    def tracker(cls, params: AutopilotParams) -> Mapping[str, str] | None:
        """By acceleration where kybflow knows better than the autopilot where it is, and says
        often enough where to go."""
        leads = params.position == "outside" and params.rate >= OFTEN
        return {"use": "on_board", "by": "acceleration" if leads else "position"}

    @classmethod
    def control_rate(cls, params: AutopilotParams) -> int:
        return SLOW if 2 * params.rate <= SLOW else QUICK

    @classmethod
    def shows(cls, params: MavlinkParams) -> bool:
        return params.simulator

    @classmethod
    def objection(cls, params: MavlinkParams) -> Objection | None:
        from kybflow.drivers.mavlink.transport.address import read_address

        try:
            if params.address is not None:
                read_address(params.address)
        except DriverError as error:
            return Objection("address", str(error))
        return None

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.mavlink.session import open_session

        return open_session(seats)
