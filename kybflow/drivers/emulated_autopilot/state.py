"""The state of an emulated autopilot, shared by its controllers, its firmware and its messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Time
from kybflow.drivers.emulated_autopilot.control.setpoints import AttitudeTarget
from kybflow.drivers.emulated_autopilot.estimator import EmulatedEstimator
from kybflow.drivers.emulated_autopilot.parameters import EmulatedParameters
from kybflow.drivers.emulation.body import BatteryMonitor
from kybflow.drivers.emulation.breaking import Failures
from kybflow.drivers.emulation.control import PositionTarget
from kybflow.drivers.mavlink.protocol.frames import Tangent
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.drivers.mavlink.telemetry.received_status import LandedState
from kybflow.world.vehicle_context import Airframe

CRITICAL, WARNING = mavlink.MAV_SEVERITY_CRITICAL, mavlink.MAV_SEVERITY_WARNING
INFO = mavlink.MAV_SEVERITY_INFO
PILOT_LOST: Time = 3 * NS // 2
"""A transmitter that is silent for longer counts as lost."""


class Role(Enum):
    """What the vehicle does in a mode."""

    FOLLOW = "follow"
    HOLD = "hold"
    TAKE_OFF = "take off"
    LAND = "land"
    RETURN = "return"
    PILOT = "pilot"


class FlightMode(NamedTuple):
    """A mode of a firmware. number: its custom_mode. needs_position: whether it needs a
    position."""

    name: str
    number: int
    role: Role
    needs_position: bool = True


class PilotSticks(NamedTuple):
    """The sticks of a transmitter. roll, pitch, yaw: -1 to 1, positive to the right, forward and
    clockwise. throttle: 0 to 1."""

    time: Time
    roll: float
    pitch: float
    yaw: float
    throttle: float


class FailsafeAction(NamedTuple):
    """A failsafe: a change to a mode, or a stop of the rotors if `mode` is None. words: the text to
    send. cause: what triggered it; each cause acts only once."""

    mode: int | None
    words: str
    cause: str


@dataclass
class AutopilotFailures(Failures):
    """The failures of an emulated autopilot.

    blind: it ignores external vision.
    refuse: the text with which it refuses to arm.
    bar: the text with which it refuses every mode.
    tilt: the tilt that it estimates before it is armed, degrees.
    pilot: the mode selected by a transmitter that is switched on.
    """

    blind: bool = False
    refuse: str = ""
    bar: str = ""
    tilt: float = 0.0
    pilot: str = ""


@dataclass
class EmulatedState:
    """The state shared by the parts of an emulated autopilot.

    modes: the firmware's modes, by number.
    loss_parameter: the parameter with the seconds after which setpoints count as lost.
    mode, asked: the number of the mode in force, and of the last requested one.
    wanted, wanted_at: the last setpoint, and when it arrived.
    stations: when each ground station sent its last heartbeat, by system id.
    home: the home position in the local frame, metres.
    ground: the height at which the vehicle stood when it was armed, metres.
    climb_to: the target height of a take-off under way, metres.
    failed_over: the cause of the failsafe in force.
    """

    modes: Mapping[int, FlightMode]
    loss_parameter: str
    parameters: EmulatedParameters
    airframe: Airframe
    estimator: EmulatedEstimator
    failures: AutopilotFailures
    battery: BatteryMonitor
    say: Callable[[str, int], None]
    mode: int
    asked: int
    armed: bool = False
    armed_at: Time = 0
    has_flown: bool = False
    landed: LandedState = LandedState.GROUND
    landed_at: Time = 0
    wanted: PositionTarget | AttitudeTarget | None = None
    wanted_at: Time | None = None
    stations: dict[int, Time] = field(default_factory=dict)
    sticks: PilotSticks | None = None
    origin: Tangent | None = None
    home: Vec3 | None = None
    ground: float = 0.0
    climb_to: float | None = None
    failed_over: str = ""

    @property
    def flying(self) -> FlightMode:
        """The mode in force."""
        return self.modes[self.mode]

    @property
    def is_down(self) -> bool:
        return self.landed is LandedState.GROUND

    def streams(self, now: Time) -> bool:
        """Return whether setpoints are arriving: whether the last one is no older than
        `loss_parameter` allows."""
        timeout = self.parameters.get(self.loss_parameter, 1.0)
        return self.wanted_at is not None and now - self.wanted_at <= timeout * NS

    def has_pilot(self, now: Time) -> bool:
        """Return whether a transmitter is received."""
        return self.sticks is not None and now - self.sticks.time < PILOT_LOST
