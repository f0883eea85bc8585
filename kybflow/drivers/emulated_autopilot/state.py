"""What an emulated autopilot is doing: the state that its parts share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Battery, Time
from kybflow.drivers.emulated_autopilot.control.control import Goal
from kybflow.drivers.emulated_autopilot.control.setpoints import Tilt
from kybflow.drivers.emulated_autopilot.estimation.estimator import Estimator
from kybflow.drivers.emulated_autopilot.firmware.firmware import Firmware, Mode
from kybflow.drivers.emulated_autopilot.firmware.parameters import Parameters
from kybflow.drivers.mavlink.protocol.frames import Tangent
from kybflow.world.vehicle_context import Airframe

CRITICAL, WARNING, INFO = 2, 4, 6
"""Severities of STATUSTEXT."""


class Landed(IntEnum):
    """MAV_LANDED_STATE."""

    GROUND = 1
    AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class Sticks(NamedTuple):
    """What a transmitter says: -1 to 1 (to the right, forward, clockwise), throttle 0 to 1."""

    time: Time
    roll: float
    pitch: float
    yaw: float
    throttle: float


@dataclass
class Failures:
    """What is broken on purpose, for tests.

    silent: it sends nothing. deaf: it hears nothing. blind: it does not see external vision.
    battery: the charge that it believes to have, 0 to 1. refuses: words with which it will not
    arm. bars: words with which it changes no mode. drops: the part of all messages that is lost, in
    and out. leans: the tilt that it believes to have before it is armed, radians.
    """

    silent: bool = False
    deaf: bool = False
    blind: bool = False
    battery: float | None = None
    refuses: str = ""
    bars: str = ""
    drops: float = 0.0
    leans: float = 0.0


@dataclass
class State:
    """mode: in force; asked: the last that somebody asked for. wanted, wanted_at: the last
    set-point, and when it came. stations: when each ground station was heard last, by system id.
    home: in the local frame. ground: the height at which it stood when it was armed."""

    firmware: Firmware
    parameters: Parameters
    airframe: Airframe
    estimator: Estimator
    say: Callable[[str, int], None]
    failures: Failures = field(default_factory=Failures)
    mode: int = 0
    asked: int = 0
    armed: bool = False
    armed_at: Time = 0
    has_flown: bool = False
    landed: Landed = Landed.GROUND
    landed_at: Time = 0
    battery: Battery | None = None
    wanted: Goal | Tilt | None = None
    wanted_at: Time | None = None
    stations: dict[int, Time] = field(default_factory=dict)
    sticks: Sticks | None = None
    origin: Tangent | None = None
    home: Vec3 | None = None
    ground: float = 0.0
    climb_to: float | None = None
    failed_over: str = ""

    @property
    def flying(self) -> Mode:
        """The mode in force."""
        return self.firmware.modes[self.mode]

    @property
    def is_down(self) -> bool:
        return self.landed is Landed.GROUND

    @property
    def remaining(self) -> float:
        """Charge that it believes to have, 0 to 1."""
        if self.failures.battery is not None:
            return self.failures.battery
        return 1.0 if self.battery is None else self.battery.remaining

    @property
    def voltage(self) -> float:
        """Of a pack with three cells where a charge is made up."""
        if self.failures.battery is not None:
            return 9.6 + 3.0 * self.failures.battery
        return 0.0 if self.battery is None else self.battery.voltage

    def streams(self, now: Time) -> bool:
        """Whether set-points come: two in a second at least, or as the parameter says."""
        patience = self.parameters.get("COM_OF_LOSS_T", 1.0)
        return self.wanted_at is not None and now - self.wanted_at <= patience * 1e9
