"""The state of an emulated autopilot, shared by its controllers, its firmware and its messages.

If parameters that are integers are sent bytewise, the float in the message holds the bytes of an
INT32 (param_type 6). Otherwise they are sent as plain floats, with their type in the type field.
Pulses of outputs are in microseconds; a servo is open at pulses below `MIDDLE`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Time
from kybflow.drivers.emulated_autopilot.estimator import EmulatedEstimator
from kybflow.drivers.emulated_autopilot.setpoints import AttitudeTarget
from kybflow.drivers.emulation.body import BatteryMonitor
from kybflow.drivers.emulation.breaking import Failures
from kybflow.drivers.emulation.control import PositionTarget
from kybflow.drivers.mavlink.protocol.frames import Tangent
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.drivers.mavlink.telemetry.received_status import LandedState
from kybflow.world.vehicle_context import Airframe

REAL = mavlink.MAV_PARAM_TYPE_REAL32
INTEGER = mavlink.MAV_PARAM_TYPE_INT32
TYPE_MISMATCH = 7
"""A MAV_PARAM_ERROR that pymavlink doesn't name yet."""


class EmulatedParameters:
    """All parameters by name, in the order of their indices.

    own: the firmware's defaults.
    changes: values that differ from them.
    bytewise: whether integers are sent bytewise.
    tells_errors: whether a PARAM_ERROR answers requests that can't be carried out.
    dangling: names to which requests are never answered, for tests.
    """

    def __init__(
        self,
        own: Mapping[str, float],
        changes: Mapping[str, float],
        *,
        bytewise: bool,
        tells_errors: bool,
    ) -> None:
        values = dict(sorted({**own, **changes}.items()))
        self._bytewise, self._tells_errors = bytewise, tells_errors
        known = {**values, **own}
        self._integers = {name for name, value in known.items() if isinstance(value, int)}
        self._values: dict[str, float] = {name: float(value) for name, value in values.items()}
        self.dangling: set[str] = set()

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def get(self, name: str, default: float = 0.0) -> float:
        return self._values.get(name, default)

    def handle(self, message: Any) -> list[Any]:
        """Return the replies to a PARAM_REQUEST_LIST, PARAM_REQUEST_READ or PARAM_SET."""
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            return [self._value_message(name) for name in self._values if name not in self.dangling]
        name = message.param_id
        name = (name.decode("ascii", "replace") if isinstance(name, bytes) else name).rstrip("\0")
        if kind == "PARAM_REQUEST_READ" and message.param_index >= 0:
            names = list(self._values)
            name = names[message.param_index] if message.param_index < len(names) else ""
        if name in self.dangling:
            return []
        if name not in self._values:
            return self._error(message, name, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
        if kind == "PARAM_SET":
            value, own = message.param_value, INTEGER if name in self._integers else REAL
            if self._tells_errors and message.param_type != own:
                return self._error(message, name, TYPE_MISMATCH)
            if self._bytewise and message.param_type == INTEGER:
                value = struct.unpack("<i", struct.pack("<f", value))[0]
            self._values[name] = float(value)
        return [self._value_message(name)]

    def _error(self, message: Any, name: str, error: int) -> list[Any]:
        if not self._tells_errors:
            return []
        to = message.get_srcSystem(), message.get_srcComponent()
        index = getattr(message, "param_index", -1)
        return [mavlink.MAVLink_param_error_message(*to, name.encode(), index, error)]

    def _value_message(self, name: str) -> Any:
        value, kind = self._values[name], INTEGER if name in self._integers else REAL
        if self._bytewise and kind == INTEGER:
            value = struct.unpack("<f", struct.pack("<i", round(value)))[0]
        index = list(self._values).index(name)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(self._values), index
        )


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
        """Return whether the signal of a transmitter is being received."""
        return self.sticks is not None and now - self.sticks.time < PILOT_LOST


MIDDLE = 1500
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED
FAILED: int = mavlink.MAV_RESULT_FAILED
DENIED: int = mavlink.MAV_RESULT_DENIED
OUTPUT_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_SERVO, mavlink.MAV_CMD_DO_SET_RELAY,
        mavlink.MAV_CMD_DO_SET_ACTUATOR, mavlink.MAV_CMD_DO_GRIPPER,
    }
)  # fmt: skip


class Outputs:
    """The outputs of one vehicle.

    pulses: the current pulse of each output, by channel.
    channel: the channel of the payload's servo; None without a payload.
    servo_pulses: the pulse of an open servo, and that of a closed one.
    closed: whether the payload's servo is closed at first.
    move: opens or closes the payload's servo.
    """

    def __init__(
        self,
        state: EmulatedState,
        channel: int | None,
        servo_pulses: tuple[int, int],
        closed: bool,
        move: Callable[[bool, Time], None],
    ) -> None:
        self.state, self._channel, self._move = state, channel, move
        self.pulses: dict[int, int] = {}
        if channel is not None:
            self.pulses[channel] = servo_pulses[closed]

    def move_all(self, parameter: str, function: int, pulse: int, now: Time) -> bool:
        """Move all outputs with this function; return whether there are any. parameter: the name of
        the parameter that holds an output's function, with `{}` in place of the output's number."""
        found = [
            channel
            for channel in range(1, 15)
            if self.state.parameters.get(parameter.format(channel)) == function
        ]
        for channel in found:
            self.move(channel, pulse, now)
        return bool(found)

    def move(self, channel: int, pulse: int, now: Time) -> None:
        """Set the pulse of one output."""
        before, self.pulses[channel] = self.pulses.get(channel), pulse
        if channel != self._channel or before is None:
            return
        if (before < MIDDLE) != (pulse < MIDDLE):
            try:
                self._move(pulse < MIDDLE, now)
            except Refused:
                self.pulses[channel] = before
