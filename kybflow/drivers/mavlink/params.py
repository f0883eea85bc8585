"""The parameters of a vehicle on an autopilot, real or emulated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from kybflow.core.params import param, params
from kybflow.core.units import Duration, Frequency
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    FirmwareName = str
else:
    FirmwareName = Literal[firmware_names("mavlink")]


@params
class AutopilotLinkParams:
    """What is asked of every autopilot, also of an emulated one."""

    autopilot: FirmwareName = param("Whose firmware it is.", read_only=True)
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
    shared: bool = param(
        "Whether others may command it too, such as a second ground station; else a run in which"
        " somebody does has not succeeded.",
        default=False, read_only=True,
    )  # fmt: skip


@params
class MavlinkParams(AutopilotLinkParams):
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
    attitude: bool = param(
        "Experimental: whether it is sent attitudes or body rates with a thrust by trackers that"
        " give them. In the firmwares' own simulators every flight so on ArduPilot fell after the"
        " take-off, and PX4 swung by 10 to 20 cm.",
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
