"""What differs between the firmwares that are emulated, as data; the numbers as they were observed.

Times are in seconds of the run, lengths in metres. `px4.py` and `ardupilot.py` fill it in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from kybflow.drivers.mavlink.protocol.frames import Tangent


class Role(Enum):
    """What a mode makes the vehicle do."""

    FOLLOW = "follow"
    HOLD = "hold"
    TAKE_OFF = "take off"
    LAND = "land"
    RETURN = "return"
    PILOT = "pilot"


class Mode(NamedTuple):
    """A mode of a firmware. number: its custom_mode. needs_position: whether it can't be flown
    without one."""

    name: str
    number: int
    role: Role
    needs_position: bool = True


@dataclass(frozen=True, slots=True)
class Firmware:
    """One firmware.

    autopilot: its number in HEARTBEAT. version: of AUTOPILOT_VERSION. start, follow, hold, land,
    back: numbers of the modes in which it starts, follows set-points, waits, lands, returns.
    parameters: its own defaults; integers are integers of the wire too. bytewise: whether they
    travel as bytes in the float. streams: what it sends unasked, hertz by the message's name.
    denied: the acknowledgement of what it can't do now. forgets: when its estimator gives up a
    position that is not seen any more. gives_up: when it lands because of that. waits: seconds
    from the first fix of GPS to a position, which real ones take longer for. idles: seconds after
    which it disarms on the ground when it never took off. takes_off: climb of a take-off, m/s.
    obeys_on_ground: whether set-points alone make it leave the ground. origin: where its simulator
    begins.
    """

    name: str
    autopilot: int
    version: tuple[int, int, int]
    modes: Mapping[int, Mode]
    start: int
    follow: int
    hold: int
    land: int
    back: int
    parameters: Mapping[str, float]
    bytewise: bool
    streams: Mapping[str, float]
    denied: int
    forgets: float
    gives_up: float
    waits: float
    takes_off: float
    obeys_on_ground: bool
    origin: Tangent


def by_number(*modes: Mode) -> dict[int, Mode]:
    return {mode.number: mode for mode in modes}
