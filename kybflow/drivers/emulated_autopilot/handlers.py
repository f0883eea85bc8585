"""The reactions of an emulated autopilot to each message and command that it receives."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

from kybflow.core.geometry import Vec3, heading_of
from kybflow.drivers.emulated_autopilot import setpoints
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.channel import AUTOPILOT, Channel, name_of
from kybflow.drivers.emulated_autopilot.estimator import VisionPose
from kybflow.drivers.emulated_autopilot.state import (
    ACCEPTED,
    CRITICAL,
    DENIED,
    FAILED,
    INFO,
    OUTPUT_COMMANDS,
    UNSUPPORTED,
    PilotSticks,
    Role,
)
from kybflow.drivers.emulated_autopilot.telemetry import (
    MAKERS,
    autopilot_version,
    gps_global_origin,
)
from kybflow.drivers.emulation.control import PositionTarget
from kybflow.drivers.mavlink.protocol.frames import (
    Tangent,
    attitude_from_ned,
    from_ned,
    heading_from_ned,
    to_ned,
)
from kybflow.drivers.mavlink.protocol.framing import mavlink

RELATIVE = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)  # fmt: skip
"""Frames whose heights are measured from the home position."""
CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
NAK, UNKNOWN_COMMAND = 129, 7
"""Values of the file transfer protocol: NAK, and the reason for it."""
PULSE_RELEASED, PULSE_IGNORED = 0, 65535
"""Special pulses of an overridden channel: return it to the transmitter; leave it unchanged."""
GROUPS = {
    "RAW_SENSORS": (1, "RAW_IMU"),
    "EXTENDED_STATUS": (2, "SYS_STATUS", "GPS_RAW_INT", "EXTENDED_SYS_STATE", "BATTERY_STATUS"),
    "RC_CHANNELS": (3, "RC_CHANNELS", "SERVO_OUTPUT_RAW"),
    "POSITION": (6, "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    "EXTRA1": (10, "ATTITUDE"),
    "EXTRA2": (11, "VFR_HUD"),
    "EXTRA3": (12, "EKF_STATUS_REPORT", "SYSTEM_TIME"),
}
"""The groups of REQUEST_DATA_STREAM: their number and their messages."""


KEPT_OUT = {
    getattr(mavlink, f"MAV_CMD_{name}"): name
    for name in (
        "DO_REPOSITION", "DO_ORBIT", "DO_CHANGE_SPEED", "CONDITION_YAW", "GET_HOME_POSITION",
        "MISSION_START",
    )
}  # fmt: skip
"""Commands that the firmwares carry out, but not their emulations (docs/adr/0025)."""


def not_emulated(name: str) -> str:
    """Return the text with which an emulation refuses what the firmware can do."""
    return f"not emulated: {name}"


class MessageHandlers:
    """The handlers of one channel's messages. Each returns the answer to send, or None."""

    def __init__(self, autopilot: OnboardAutopilot, channel: Channel) -> None:
        a, self._channel = autopilot, channel
        self._a, self._commands = autopilot, CommandHandlers(autopilot, channel)
        self._handlers: dict[str, Callable[[Any], Any]] = {
            "HEARTBEAT": self._heartbeat,
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_MODE": self._set_mode,
            "PARAM_REQUEST_LIST": self._parameter,
            "PARAM_REQUEST_READ": self._parameter,
            "PARAM_SET": self._parameter,
            "SET_POSITION_TARGET_LOCAL_NED": self._position_target,
            "SET_POSITION_TARGET_GLOBAL_INT": self._global_target,
            "SET_ATTITUDE_TARGET": lambda m: self._follow(setpoints.attitude_target(m)),
            "ODOMETRY": self._pose,
            "VISION_POSITION_ESTIMATE": lambda m: self._see(
                m.usec, (m.x, m.y, m.z), heading_from_ned(m.yaw), m.reset_counter
            ),
            "ATT_POS_MOCAP": self._pose,
            "TIMESYNC": lambda m: (
                mavlink.MAVLink_timesync_message(a.boot_us(a.now) * 1000, m.ts1)
                if m.tc1 == 0
                else None
            ),
            "FILE_TRANSFER_PROTOCOL": self._files,
            "PING": lambda m: (
                mavlink.MAVLink_ping_message(m.time_usec, m.seq, *_sender(m))
                if m.target_system == 0 and a.firmware.answers_pings
                else None
            ),
            "MISSION_REQUEST_LIST": self._missions,
            "MISSION_COUNT": self._missions,
            "MISSION_CLEAR_ALL": self._missions,
            "LOG_REQUEST_LIST": lambda _: a.state.say(not_emulated("logs"), CRITICAL),
            "REQUEST_DATA_STREAM": self._data_stream,
            "AUTOPILOT_VERSION_REQUEST": lambda _: autopilot_version(a),
            "SET_GPS_GLOBAL_ORIGIN": self._origin,
            "RC_CHANNELS_OVERRIDE": self._override,
            "MANUAL_CONTROL": self._manual,
        }

    def handle(self, message: Any) -> None:
        """Handle a message, unless it is addressed to another vehicle."""
        target = getattr(message, "target_system", 0)
        if target not in (0, self._a.system) or message.get_srcSystem() == self._a.system:
            return
        component = getattr(message, "target_component", 0)
        if component not in (0, AUTOPILOT) and not self._a.firmware.answers_for_all:
            return
        handle = self._handlers.get(message.get_type())
        answer = None if handle is None else handle(message)
        if answer is not None:
            self._channel.send(answer)

    def _heartbeat(self, m: Any) -> None:
        a = self._a
        if m.type == mavlink.MAV_TYPE_GCS:
            self._channel.station = a.now
            a.state.stations[m.get_srcSystem()] = a.now
        elif a.firmware.every_heartbeat_counts:
            a.state.stations[m.get_srcSystem()] = a.now

    def _command(self, m: Any) -> Any:
        result = self._commands.carry_out(m)
        if result is None:
            return None
        return mavlink.MAVLink_command_ack_message(m.command, result, 255, 0, *_sender(m))

    def _set_mode(self, m: Any) -> None:
        if m.base_mode & CUSTOM:
            self._commands.set_mode(m.custom_mode)

    def _parameter(self, m: Any) -> None:
        for answer in self._a.state.parameters.handle(m):
            self._channel.send(answer)

    def _follow(self, wanted: setpoints.AttitudeTarget | PositionTarget | None) -> None:
        """Store a setpoint; some firmwares drop setpoints in other modes."""
        a = self._a
        if wanted is not None and (
            a.firmware.keeps_setpoints or a.state.flying.role is Role.FOLLOW
        ):
            a.state.wanted, a.state.wanted_at = wanted, a.now
            if isinstance(wanted, setpoints.AttitudeTarget):
                a.state.climb_to = None  # an attitude ends a take-off, a position follows it

    def _position_target(self, m: Any) -> None:
        e, by_axis = self._a.state.estimator, self._a.firmware.by_axis
        target = setpoints.position_target(m, e.position, e.attitude.heading, by_axis=by_axis)
        if self._a.firmware.looks_ahead and target is not None:
            target = setpoints.looking_ahead(target, self._a.state.wanted, e.position)
        self._follow(target)

    def _global_target(self, m: Any) -> None:
        a = self._a
        origin = a.state.origin
        if origin is None:
            return
        x, y, z = origin.local(m.lat_int * 1e-7, m.lon_int * 1e-7, m.alt)
        if m.coordinate_frame in RELATIVE:
            z = m.alt + (a.state.home or (0.0, 0.0, 0.0))[2]
        self._position_target(setpoints.as_local(m, to_ned((x, y, z))))

    def _pose(self, m: Any) -> None:
        firmware, is_odometry = self._a.firmware, m.get_type() == "ODOMETRY"
        if is_odometry:
            is_body = m.child_frame_id == mavlink.MAV_FRAME_BODY_FRD
            is_used = is_body and m.frame_id in firmware.vision_frames
        else:
            is_used = firmware.takes_mocap
        if is_used:
            w, x, y, z = m.q
            heading = heading_of(attitude_from_ned((w, x, y, z)))
            resets = m.reset_counter if is_odometry else 0
            self._see(m.time_usec, (m.x, m.y, m.z), heading, resets)

    def _see(self, stamp: int, ned: Vec3, heading: float, resets: int) -> None:
        a = self._a
        if not a.state.failures.blind:
            at = a.run_time(stamp)
            a.state.estimator.see(VisionPose(at, from_ned(ned), heading, resets), a.now)

    def _files(self, m: Any) -> Any:
        """Refuse file transfers at once, so that no client waits for a timeout."""
        asked = bytes(m.payload)
        number = (int.from_bytes(asked[:2], "little") + 1) & 0xFFFF
        head = [*number.to_bytes(2, "little"), asked[2], NAK, 1, asked[3], 0, 0, 0, 0, 0, 0]
        answer = [*head, UNKNOWN_COMMAND, *[0] * (251 - len(head) - 1)]
        return mavlink.MAVLink_file_transfer_protocol_message(0, *_sender(m), answer)

    def _missions(self, m: Any) -> Any:
        """Answer that the autopilot stores no mission, and reject any that is sent."""
        to, kind = _sender(m), getattr(m, "mission_type", 0)
        if m.get_type() == "MISSION_REQUEST_LIST":
            return mavlink.MAVLink_mission_count_message(*to, 0, kind)
        is_clearing = m.get_type() == "MISSION_CLEAR_ALL"
        result = mavlink.MAV_MISSION_ACCEPTED if is_clearing else mavlink.MAV_MISSION_UNSUPPORTED
        if not is_clearing:
            self._a.state.say(not_emulated("missions"), CRITICAL)
        return mavlink.MAVLink_mission_ack_message(*to, result, kind)

    def _data_stream(self, m: Any) -> None:
        rate = float(m.req_message_rate) if m.start_stop else 0.0
        for number, *names in GROUPS.values():
            if m.req_stream_id in (0, number):
                for name in names:
                    self._channel.stream(str(name), rate)

    def _origin(self, m: Any) -> Any:
        a = self._a
        if a.state.origin is not None:
            return None
        latitude, longitude = m.latitude * 1e-7, m.longitude * 1e-7
        a.state.origin = Tangent.on_ellipsoid(latitude, longitude, m.altitude * 1e-3)
        return gps_global_origin(a)

    def _override(self, m: Any) -> None:
        """Accept stick positions from the ground station that the vehicle obeys; ignore those from
        other stations."""
        a = self._a
        if m.get_srcSystem() != int(a.state.parameters.get("SYSID_MYGCS", m.get_srcSystem())):
            return
        pulses = (m.chan1_raw, m.chan2_raw, m.chan3_raw, m.chan4_raw)
        if any(pulse in (PULSE_RELEASED, PULSE_IGNORED) for pulse in pulses):
            a.state.sticks = None if PULSE_RELEASED in pulses else a.state.sticks
            return
        roll, pitch, throttle, yaw = pulses
        a.state.sticks = PilotSticks(
            a.now,
            (roll - 1500) / 500,
            (1500 - pitch) / 500,
            (yaw - 1500) / 500,
            (throttle - 1000) / 1000,
        )

    def _manual(self, m: Any) -> None:
        a = self._a
        if m.target == a.system:
            a.state.sticks = PilotSticks(a.now, m.y / 1000, m.x / 1000, m.r / 1000, m.z / 1000)


def _sender(m: Any) -> tuple[int, int]:
    return m.get_srcSystem(), m.get_srcComponent()


FORCE = 21196
"""The second parameter of COMPONENT_ARM_DISARM that forces arming or disarming."""

Params = tuple[float, ...]


class CommandHandlers:
    """The handlers of one channel's commands, with the acknowledgements observed on the
    firmwares."""

    def __init__(self, autopilot: OnboardAutopilot, channel: Channel) -> None:
        self._a, self._channel, modes = autopilot, channel, autopilot.firmware
        self._actions: dict[int, Callable[[Params], int | None]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda _: self.set_mode(modes.land),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self.set_mode(modes.back),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda _: self.set_mode(modes.loiter),
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE: self._pause,
            mavlink.MAV_CMD_DO_SET_HOME: self._set_home,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: lambda _: self._request(
                (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)
            ),
        }

    def carry_out(self, message: Any) -> int | None:
        """Carry out a COMMAND_LONG or COMMAND_INT; return the acknowledgement, None if the firmware
        sends none."""
        m, number = message, message.command
        if m.get_type() == "COMMAND_INT":
            p: Params = (m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z)
        else:
            p = (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
        if number in OUTPUT_COMMANDS:
            return self._a.firmware.move_output(self._a.outputs, number, p, self._a.now)
        if number in KEPT_OUT:
            self._a.state.say(not_emulated(KEPT_OUT[number]), CRITICAL)
        action = self._actions.get(number)
        if action is None or number in self._a.firmware.unsupported:
            return UNSUPPORTED
        return action(p)

    def set_mode(self, number: int) -> int:
        """Change to a mode, or send a text with the reason for refusing it; return the
        acknowledgement."""
        a = self._a
        if number not in a.firmware.modes:
            return a.firmware.unknown_mode
        reason = a.firmware.refuses_mode(a.state, number, a.now)
        if reason:
            a.state.say(reason, CRITICAL)
            return a.firmware.denied
        a.state.failed_over = ""
        a.change(number, a.now, asked=True)
        return ACCEPTED

    def _do_set_mode(self, p: Params) -> int:
        a = self._a
        if not int(p[0]) & CUSTOM:
            return a.firmware.unknown_mode
        return self.set_mode(a.firmware.mode_number(p))

    def _arm(self, p: Params) -> int | None:
        a = self._a
        state, forced = a.state, p[1] == FORCE
        if p[0] not in (0.0, 1.0):
            if not a.firmware.wrong_arming_text:
                return UNSUPPORTED
            state.say(a.firmware.wrong_arming_text.format(p[0]), CRITICAL)
            return None
        if p[0] == 0.0:
            if not state.armed:
                return ACCEPTED
            if not (state.is_down or forced):
                a.state.say(a.firmware.not_landed_text, CRITICAL)
                return a.firmware.denied
            a.stop(a.now, a.firmware.disarmed_text)
            return ACCEPTED
        if state.armed:
            return ACCEPTED
        reason = "" if forced else a.firmware.refuses_arming(state, a.now)
        if reason:
            for text in a.firmware.refusal_texts(reason):
                state.say(text, CRITICAL)
            return a.firmware.denied
        a.start(a.now)
        return ACCEPTED

    def _take_off(self, p: Params) -> int:
        a = self._a
        state, up = a.state, p[6]
        here = state.estimator.position[2]
        if not a.firmware.takeoff_parameter:
            if state.flying.role is not Role.FOLLOW or not state.armed or not state.is_down:
                return FAILED
            if not state.estimator.has_position(a.now):
                return FAILED
            state.wanted = None
            a.flight.enter(a.now)
            state.climb_to = here + up
            return ACCEPTED
        low = here + state.parameters[a.firmware.takeoff_parameter]
        sea = None if state.origin is None else up - state.origin.height
        mode = next(n for n, mode in a.firmware.modes.items() if mode.role is Role.TAKE_OFF)
        a.change(mode, a.now, asked=True)
        state.climb_to = low if sea is None or not isfinite(sea) else max(sea, here + 0.5)
        return ACCEPTED

    def _pause(self, p: Params) -> int:
        """Hold the position in a mode that follows setpoints."""
        a, resumes = self._a, p[0] == 1.0
        if p[0] not in (0.0, 1.0):
            return DENIED
        if a.state.flying.role is not Role.FOLLOW:
            a.state.say(f"Failed to {'resume' if resumes else 'pause'}", INFO)
            return FAILED
        if not resumes:
            a.state.wanted = None
            a.flight.enter(a.now)
        return ACCEPTED

    def _set_home(self, p: Params) -> int:
        a = self._a
        if a.state.origin is None:
            return a.firmware.denied
        a.state.home = a.state.estimator.position
        return ACCEPTED

    def _set_interval(self, p: Params) -> int:
        name, channel, firmware = name_of(int(p[0])), self._channel, self._a.firmware
        if name not in MAKERS or name in firmware.profile.polled | firmware.lacks:
            return firmware.stream_refused
        default = channel.default(name)
        channel.stream(name, default if p[1] == 0.0 else 0.0 if p[1] < 0.0 else 1e6 / p[1])
        return ACCEPTED

    def _get_interval(self, p: Params) -> int:
        apart = round(1e6 * self._channel.interval(name_of(int(p[0])))) or -1
        self._channel.send(mavlink.MAVLink_message_interval_message(int(p[0]), apart))
        return ACCEPTED

    def _request(self, p: Params) -> int:
        firmware, name = self._a.firmware, name_of(int(p[0]))
        maker = MAKERS.get(name)
        if maker is None or name in firmware.lacks:
            return firmware.message_refused
        message = maker(self._a)
        if message is None:
            return FAILED
        self._channel.send(message)
        return ACCEPTED
