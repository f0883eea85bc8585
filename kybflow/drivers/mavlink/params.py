"""Parameters of a vehicle with an autopilot, real or emulated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from kybflow.core.params import param, params
from kybflow.core.signals import CommandKind
from kybflow.core.units import Duration, Frequency
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    FirmwareName = str
else:
    FirmwareName = Literal[firmware_names("mavlink")]

THRUSTS = frozenset({CommandKind.ATTITUDE_THRUST, CommandKind.RATES_THRUST})
"""Kinds of commands that an autopilot follows without its own position."""


@params
class AutopilotLinkParams:
    """The parameters that real and emulated autopilots share."""

    autopilot: FirmwareName = param("The firmware.", read_only=True)
    position: Literal["outside", "own"] = param(
        "Source of the autopilot's position: `outside`, sent by kybflow, or its `own`, such as "
        "GPS.",
        default="outside", read_only=True,
    )  # fmt: skip
    rate: Frequency = param(
        "Setpoints a second.", default=50.0, at_least=5.0, at_most=250.0, read_only=True
    )
    vision_rate: Frequency = param(
        "Poses per second that are sent to the autopilot.",
        default=30.0, at_least=3.0, at_most=120.0, read_only=True,
    )  # fmt: skip
    after_failsafe: Literal["land", "resume"] = param(
        "What happens after the autopilot's own failsafe, once the link is good again: the vehicle"
        " lands, or resumes its mission. Control is never taken back from a person without a "
        "command.",
        default="land", read_only=True,
    )  # fmt: skip
    shared: bool = param(
        "Whether others, such as a second ground station, may also command the vehicle; "
        "otherwise a run fails if one does.",
        default=False, read_only=True,
    )  # fmt: skip


@params
class MavlinkParams(AutopilotLinkParams):
    address: str | None = param(
        "The autopilot's address: `udpin:HOST:PORT`, `udpout:HOST:PORT`, `tcp:HOST:PORT` or"
        " `serial:DEVICE:BAUD`; by default that of the firmware's own simulator.",
        default=None, read_only=True,
    )  # fmt: skip
    system: int | None = param(
        "The autopilot's system id; by default its number among the mission's vehicles, from 1.",
        default=None, at_least=1, at_most=254, read_only=True,
    )  # fmt: skip
    own_system: int = param(
        "The system id of this program.", default=245, at_least=1, at_most=255, read_only=True
    )
    simulator: bool = param(
        "Whether it is the firmware's own simulator, whose ground truth simulated sensors may"
        " use.",
        default=False, read_only=True,
    )  # fmt: skip
    attitude: bool = param(
        "Experimental: whether trackers may send attitudes or body rates with a thrust. In the "
        "firmwares' own simulators, ArduPilot always fell after the take-off, and PX4 oscillated "
        "by 10 to 20 cm.",
        default=False, read_only=True,
    )  # fmt: skip
    key: str | None = param(
        "File with the secret of signed messages: 32 bytes, or a passphrase. Unsigned messages"
        " are then dropped.",
        default=None, read_only=True,
    )  # fmt: skip
    lead: Duration | None = param(
        "The autopilot's latency, for which setpoints are predicted; by default as measured in "
        "its own simulator.",
        default=None, at_least=0.0, at_most=1.0, read_only=True,
    )  # fmt: skip
    arming_time: Duration = param(
        "Longest duration of arming.", default=15.0, above=0.0, read_only=True
    )
