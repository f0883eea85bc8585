"""The emulated firmwares as observed: the differences between them, as data and small functions.

Each module of this package is one firmware, named like its profile in the MAVLink driver's
`firmware`; its `EMULATED` is an `EmulatedFirmware`. A firmware without a module here can be flown
but not emulated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.core.text import did_you_mean
from kybflow.drivers import firmware_names
from kybflow.drivers.emulated_autopilot.estimator import Sources
from kybflow.drivers.emulated_autopilot.setpoints import AttitudeTarget
from kybflow.drivers.emulated_autopilot.state import (
    EmulatedParameters,
    EmulatedState,
    FailsafeAction,
    FlightMode,
    Outputs,
)
from kybflow.drivers.emulation.control import Speeds
from kybflow.drivers.mavlink.firmware import OWN, FirmwareProfile, profile_of
from kybflow.drivers.mavlink.protocol.frames import Tangent
from kybflow.world.vehicle_context import VehicleContext

Values = EmulatedParameters


@dataclass(frozen=True, kw_only=True)
class EmulatedFirmware:
    """One firmware. Times are in seconds, lengths in metres.

    version: the version in AUTOPILOT_VERSION.
    modes: its modes, by number.
    start, follow, hold, land, back, loiter: the numbers of the modes in which it starts, follows
    setpoints, waits, lands and returns, and of that of MAV_CMD_NAV_LOITER_UNLIM.
    parameters: its defaults; an int is sent as an integer.
    system_parameter: the parameter that holds its system id.
    without_transmitter: the parameters that let it fly without a transmitter.
    loss_parameter: as in `EmulatedState`.
    takeoff_parameter: the parameter with the height of its take-off mode; empty if it has no such
    mode.
    setpoint_timeout: the parameter with the seconds after which a setpoint other than a position is
    dropped; None if the mode is left instead.
    streams: the messages that it sends by default, Hz by name.
    stations: addresses of ground stations to which its own simulator also sends.
    station_streams: the messages that it sends there by default, Hz by name.
    lacks: the messages that the other firmware sends, but not this one.

    unsupported: the commands that the other firmware carries out, but not this one.
    stream_refused, message_refused: its acknowledgements of a request for a stream, or for one
    message, that it can't send.
    answers_pings: whether it answers a PING to all systems.
    answers_for_all: whether it answers commands to other components of its system, too.
    tells_parameter_errors: whether it sends PARAM_ERROR.
    denied, unknown_mode: its acknowledgements of a command that it can't carry out now, and of an
    unknown mode.
    armed_text, disarmed_text, not_landed_text: its texts when it is armed, when it is disarmed, and
    when it is requested to disarm in the air.
    wrong_arming_text: its text about a wrong value in a request to arm, in place of an
    acknowledgement; empty if it acknowledges.
    text_end: a suffix of all its texts.
    mode_messages: the messages that it sends after a mode change.
    servo_function: the output function of a payload's servo.
    pulses: the pulses of an open and of a closed servo, microseconds.
    vision_frames: the frames of ODOMETRY that it accepts.
    origin: the geographic position at which its simulator begins.

    forgets: the time without measurements after which its estimator gives up the position.
    gives_up: the time without measurements after which it lands.
    adopts: as in `SightingClock`.
    averages: the time over which it averages the squares of its innovations.
    waits: the time from the first GPS fix to a position; real receivers take longer.
    takes_off: the climb rate of its take-off, m/s.
    approach: its gain from position error to velocity for a setpoint that is only a position, 1/s.
    ramp: the time in which the climb rate grows to its maximum after lift-off, s.
    looks_ahead: whether it turns towards a position setpoint without a heading.
    lands_to_return: whether the descent at the end of a return counts as landing.
    holds_unsteered: the numbers of the modes in which it holds its place as long as no transmitter
    has been received.
    obeys_on_ground: whether setpoints alone make it leave the ground.
    keeps_setpoints: whether it takes setpoints in any mode and keeps them across modes.
    returns_to_mode: whether it returns to the last requested mode once disarmed.
    by_axis: whether a setpoint may leave out single axes.
    takes_mocap: whether it fuses ATT_POS_MOCAP.
    speaks_to_all: whether it sends texts not only to ground stations.
    complains: whether it repeats unasked why it can't be armed.
    every_heartbeat_counts: whether its failsafe counts every heartbeat as a ground station's.

    sources: returns the sensors that its parameters select.
    refusal: returns why it can't be armed now, empty if it can.
    refusal_texts: returns the texts that it sends about that.
    mode_refusal: returns why it refuses a mode now, beyond the checks common to all firmwares.
    failsafe, disarms: return its reaction in the air, and on the ground.
    idle_status: returns its MAV_STATE while disarmed.
    tells_position: returns whether it reports its position.
    mode_number: returns the mode in the parameters of DO_SET_MODE.
    move_output: carries out a command to an output; returns the acknowledgement.
    speeds, land_speed: read these values from its parameters.
    return_height: returns the height above home of a return that begins `away` from home at
    `height` above it.
    climb_rate: returns the climb rate that a throttle commands; None if it commands thrust.
    """

    version: tuple[int, int, int]
    modes: Mapping[int, FlightMode]
    start: int
    follow: int
    hold: int
    land: int
    back: int
    loiter: int
    parameters: Mapping[str, float]
    system_parameter: str
    without_transmitter: frozenset[str]
    loss_parameter: str = ""
    takeoff_parameter: str = ""
    setpoint_timeout: str | None = None
    streams: Mapping[str, float]
    stations: tuple[str, ...] = ()
    station_streams: Mapping[str, float]
    lacks: frozenset[str]
    unsupported: frozenset[int] = frozenset()
    stream_refused: int
    message_refused: int
    answers_pings: bool
    answers_for_all: bool
    tells_parameter_errors: bool
    denied: int
    unknown_mode: int
    armed_text: str
    disarmed_text: str
    not_landed_text: str
    wrong_arming_text: str = ""
    text_end: str = ""
    mode_messages: tuple[str, ...]
    servo_function: int
    pulses: tuple[int, int]
    vision_frames: frozenset[int]
    origin: Tangent
    forgets: float
    gives_up: float
    waits: float
    adopts: int | None
    averages: float
    takes_off: float
    approach: float
    ramp: float
    looks_ahead: bool
    lands_to_return: bool
    holds_unsteered: frozenset[int]
    obeys_on_ground: bool
    keeps_setpoints: bool
    returns_to_mode: bool
    by_axis: bool
    takes_mocap: bool
    speaks_to_all: bool
    complains: bool
    every_heartbeat_counts: bool
    sources: Callable[[Values], Sources]
    refusal: Callable[[EmulatedState, Time], str]
    refusal_texts: Callable[[str], tuple[str, ...]]
    mode_refusal: Callable[[EmulatedState, FlightMode, Time], str]
    failsafe: Callable[[EmulatedState, Time], FailsafeAction | None]
    disarms: Callable[[EmulatedState, Time], FailsafeAction | None]
    idle_status: Callable[[EmulatedState, Time], int]
    tells_position: Callable[[EmulatedState, Time], bool]
    mode_number: Callable[[tuple[float, ...]], int]
    move_output: Callable[[Outputs, int, tuple[float, ...], Time], int]
    speeds: Callable[[Values], Speeds]
    land_speed: Callable[[Values], float]
    return_height: Callable[[Values, float, float], float]
    climb_rate: Callable[[Values, float], float | None]
    name: str = ""

    @property
    def profile(self) -> FirmwareProfile:
        """The driver's profile of this firmware."""
        return profile_of(self.name)

    def refuses_arming(self, state: EmulatedState, now: Time) -> str:
        """Return why it can't be armed now in its current mode; empty if it can."""
        return state.failures.refuse or self.refusal(state, now)

    def refuses_mode(self, state: EmulatedState, number: int, now: Time) -> str:
        """Return why it refuses to change to a mode now; empty if it doesn't."""
        mode = self.modes[number]
        if state.failures.bar:
            return state.failures.bar
        if not state.armed:
            return ""
        if mode.needs_position and not state.estimator.has_position(now):
            return f"Mode change to {mode.name} failed: requires position"
        return self.mode_refusal(state, mode, now)

    def acts(self, state: EmulatedState, now: Time) -> FailsafeAction | None:
        """Return the failsafe that begins now, or None. Called while armed."""
        if state.is_down:
            return self.disarms(state, now)
        own = self.failsafe(state, now)
        if own is None or own.mode == state.mode or own.cause == state.failed_over:
            return None
        return own

    def drops_setpoint(self, state: EmulatedState, now: Time) -> bool:
        """Return whether the last setpoint is too old to be followed."""
        wanted, at = state.wanted, state.wanted_at
        if self.setpoint_timeout is None or wanted is None or at is None:
            return False
        is_lasting = not isinstance(wanted, AttitudeTarget) and None not in wanted.position
        return not is_lasting and now - at > state.parameters[self.setpoint_timeout] * NS


class SetupPlan(NamedTuple):
    """How an autopilot is set up.

    outside: whether its position comes from a client.
    prepared: whether it is set up for kybflow.
    station: the system id of the client that it obeys.
    changes: further changes to its parameters."""

    firmware: str
    outside: bool
    prepared: bool
    station: int
    changes: Mapping[str, float] = MappingProxyType({})

    def parameters(self, context: VehicleContext, system: int) -> dict[str, float]:
        """Return the parameters that differ from the firmware's defaults. system: the vehicle's
        system id."""
        firmware = emulated_firmware(self.firmware)
        found = (
            prepared(firmware, context, system, outside=self.outside, station=self.station)
            if self.prepared
            else as_built(firmware, context, system)
        )
        return found | dict(self.changes)


@cache
def emulated_firmware(name: str) -> EmulatedFirmware:
    """Return the emulated firmware of that name. Raises DriverError if it is not emulated."""
    names = firmware_names("emulated_autopilot")
    if name not in names:
        raise DriverError(f"no emulated autopilot {name!r}: there are {' and '.join(names)}")
    firmware: EmulatedFirmware = import_module(f"{__name__}.{name}").EMULATED
    return replace(firmware, name=name)


def check_names(firmware: str, changes: Mapping[str, float]) -> None:
    """Raise DriverError if the emulated firmware lacks one of the parameters."""
    profile = profile_of(firmware)
    known = set(emulated_firmware(firmware).parameters)
    known |= {setting.name for setting in profile.indoors}
    known |= {danger.name for danger in profile.dangers}
    for name in changes.keys() - known:
        hint = did_you_mean(name, known)
        raise DriverError(f"the emulated {firmware} has no parameter {name}; {hint}")


def as_built(firmware: EmulatedFirmware, context: VehicleContext, system: int) -> dict[str, float]:
    """Return the parameters that differ from the firmware's defaults before any setup: the
    airframe's hover throttle, and the system id."""
    hover = round(context.airframe.hover_thrust / context.airframe.max_thrust, 4)
    return {firmware.profile.hover_parameter: hover, firmware.system_parameter: system}


def prepared(
    firmware: EmulatedFirmware, context: VehicleContext, system: int, *, outside: bool, station: int
) -> dict[str, float]:
    """Return the parameters of `as_built`, and those that kybflow needs for a flight.

    outside: whether the position comes from kybflow; otherwise the vehicle's own position stays
    enabled.
    station: the system id of the program that flies the vehicle.
    """
    profile = firmware.profile
    safe = {danger.name for danger in profile.dangers} | firmware.without_transmitter
    changes = as_built(firmware, context, system)
    for setting in profile.indoors:
        if outside or setting.name in safe or setting.value == OWN:
            found = firmware.parameters.get(setting.name, 0.0)
            if not setting.accepts(found, station):
                changes[setting.name] = setting.wanted(station, found)
    if context.payload is not None:
        output = profile.output(context.payload.channel, True)
        changes[output.parameter] = firmware.servo_function
    return changes


def by_number(*modes: FlightMode) -> dict[int, FlightMode]:
    """Return the modes of a firmware by number."""
    return {mode.number: mode for mode in modes}
