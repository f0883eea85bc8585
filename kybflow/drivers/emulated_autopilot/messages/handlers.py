"""What an emulated autopilot does with each message that it receives, commands excepted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kybflow.core.geometry import Vec3, heading_of
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.control import setpoints
from kybflow.drivers.emulated_autopilot.estimator import VisionPose
from kybflow.drivers.emulated_autopilot.messages.channel import AUTOPILOT, Channel
from kybflow.drivers.emulated_autopilot.messages.commands import CUSTOM, CommandHandlers
from kybflow.drivers.emulated_autopilot.messages.telemetry import MAKERS
from kybflow.drivers.emulated_autopilot.state import PilotSticks, Role
from kybflow.drivers.emulation.control import PositionTarget
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.protocol.frames import (
    Tangent,
    attitude_from_ned,
    from_ned,
    heading_from_ned,
    to_ned,
)

GROUND_STATION = 6
"""Type of a heartbeat (MAV_TYPE_GCS)."""
BODY_FRD = 12
REFUSED, UNKNOWN_COMMAND = 129, 7
"""Answers of the file transfer protocol."""
RELEASED, IGNORED = 0, 65535
"""Pulses of an overridden channel: given back to the transmitter; left as it is."""
GROUPS = {
    "RAW_SENSORS": (1, "RAW_IMU"),
    "EXTENDED_STATUS": (2, "SYS_STATUS", "GPS_RAW_INT", "EXTENDED_SYS_STATE", "BATTERY_STATUS"),
    "RC_CHANNELS": (3, "RC_CHANNELS", "SERVO_OUTPUT_RAW"),
    "POSITION": (6, "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    "EXTRA1": (10, "ATTITUDE"),
    "EXTRA2": (11, "VFR_HUD"),
    "EXTRA3": (12, "EKF_STATUS_REPORT", "SYSTEM_TIME"),
}
"""What REQUEST_DATA_STREAM asks for: its number and the messages."""


class MessageHandlers:
    """The handlers of one channel's messages."""

    def __init__(self, autopilot: OnboardAutopilot, channel: Channel) -> None:
        self._a, self._channel = autopilot, channel
        self._commands = CommandHandlers(autopilot, channel)
        self._handlers: dict[str, Callable[[Any], None]] = {
            "HEARTBEAT": self._heartbeat,
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_MODE": self._set_mode,
            "PARAM_REQUEST_LIST": self._parameter,
            "PARAM_REQUEST_READ": self._parameter,
            "PARAM_SET": self._parameter,
            "SET_POSITION_TARGET_LOCAL_NED": self._position_target,
            "SET_POSITION_TARGET_GLOBAL_INT": self._global_target,
            "SET_ATTITUDE_TARGET": self._attitude_target,
            "ODOMETRY": self._odometry,
            "VISION_POSITION_ESTIMATE": self._vision,
            "ATT_POS_MOCAP": self._mocap,
            "TIMESYNC": self._timesync,
            "FILE_TRANSFER_PROTOCOL": self._files,
            "PING": self._ping,
            "MISSION_REQUEST_LIST": self._missions,
            "MISSION_COUNT": self._missions,
            "MISSION_CLEAR_ALL": self._missions,
            "REQUEST_DATA_STREAM": self._data_stream,
            "AUTOPILOT_VERSION_REQUEST": self._version,
            "SET_GPS_GLOBAL_ORIGIN": self._origin,
            "RC_CHANNELS_OVERRIDE": self._override,
            "MANUAL_CONTROL": self._manual,
        }

    def handle(self, message: Any) -> None:
        """Handle a message, unless it is addressed to another vehicle."""
        target = getattr(message, "target_system", 0)
        if target not in (0, self._a.system) or message.get_srcSystem() == self._a.system:
            return
        if getattr(message, "target_component", 0) not in (0, AUTOPILOT):
            return
        handle = self._handlers.get(message.get_type())
        if handle is not None:
            handle(message)

    def _heartbeat(self, m: Any) -> None:
        a = self._a
        if m.type == GROUND_STATION:
            self._channel.station = a.now
            a.state.stations[m.get_srcSystem()] = a.now
        elif a.firmware.every_heartbeat_counts:
            a.state.stations[m.get_srcSystem()] = a.now

    def _command(self, m: Any) -> None:
        result = self._commands.obey(m)
        ack = mavlink.MAVLink_command_ack_message(
            m.command, result, 255, 0, m.get_srcSystem(), m.get_srcComponent()
        )
        self._channel.send(ack)

    def _set_mode(self, m: Any) -> None:
        if m.base_mode & CUSTOM:
            self._commands.set_mode(m.custom_mode)

    def _parameter(self, m: Any) -> None:
        a = self._a
        for answer in a.state.parameters.handle(m):
            self._channel.send(answer)

    def _follow(self, wanted: setpoints.AttitudeTarget | PositionTarget | None) -> None:
        """Take a setpoint; some firmwares drop it in other modes."""
        a = self._a
        if wanted is not None and (
            a.firmware.keeps_setpoints or a.state.flying.role is Role.FOLLOW
        ):
            a.state.wanted, a.state.wanted_at = wanted, a.now

    def _position_target(self, m: Any) -> None:
        a = self._a
        e = a.state.estimator
        heading = e.attitude.heading
        self._follow(setpoints.position_target(m, e.position, heading, by_axis=a.firmware.by_axis))

    def _global_target(self, m: Any) -> None:
        a = self._a
        origin = a.state.origin
        if origin is None:
            return
        x, y, z = origin.local(m.lat_int * 1e-7, m.lon_int * 1e-7, m.alt)
        if m.coordinate_frame in (3, 6):
            z = m.alt + (a.state.home or (0.0, 0.0, 0.0))[2]
        self._position_target(setpoints.as_local(m, to_ned((x, y, z))))

    def _attitude_target(self, m: Any) -> None:
        self._follow(setpoints.attitude_target(m))

    def _odometry(self, m: Any) -> None:
        a = self._a
        if m.frame_id in a.firmware.vision_frames and m.child_frame_id == BODY_FRD:
            w, x, y, z = m.q
            heading = heading_of(attitude_from_ned((w, x, y, z)))
            self._see(m.time_usec, (m.x, m.y, m.z), heading, m.reset_counter)

    def _vision(self, m: Any) -> None:
        self._see(m.usec, (m.x, m.y, m.z), heading_from_ned(m.yaw), m.reset_counter)

    def _mocap(self, m: Any) -> None:
        a = self._a
        if a.firmware.takes_mocap:
            w, x, y, z = m.q
            heading = heading_of(attitude_from_ned((w, x, y, z)))
            self._see(m.time_usec, (m.x, m.y, m.z), heading, 0)

    def _see(self, stamp: int, ned: Vec3, heading: float, resets: int) -> None:
        a = self._a
        if not a.state.failures.blind:
            at = a.run_time(stamp)
            a.state.estimator.see(VisionPose(at, from_ned(ned), heading, resets), a.now)

    def _timesync(self, m: Any) -> None:
        a = self._a
        if m.tc1 == 0:
            self._channel.send(mavlink.MAVLink_timesync_message(a.boot_us(a.now) * 1000, m.ts1))

    def _files(self, m: Any) -> None:
        """Refuse file transfers at once, so that nobody waits."""
        asked = bytes(m.payload)
        number = (int.from_bytes(asked[:2], "little") + 1) & 0xFFFF
        head = [*number.to_bytes(2, "little"), asked[2], REFUSED, 1, asked[3], 0, 0, 0, 0, 0, 0]
        answer = [*head, UNKNOWN_COMMAND, *[0] * (251 - len(head) - 1)]
        self._channel.send(
            mavlink.MAVLink_file_transfer_protocol_message(
                0, m.get_srcSystem(), m.get_srcComponent(), answer
            )
        )

    def _ping(self, m: Any) -> None:
        if m.target_system == 0:
            self._channel.send(
                mavlink.MAVLink_ping_message(
                    m.time_usec, m.seq, m.get_srcSystem(), m.get_srcComponent()
                )
            )

    def _missions(self, m: Any) -> None:
        """Answer that there is no mission, and that none is accepted."""
        to, kind = (m.get_srcSystem(), m.get_srcComponent()), getattr(m, "mission_type", 0)
        if m.get_type() == "MISSION_REQUEST_LIST":
            self._channel.send(mavlink.MAVLink_mission_count_message(*to, 0, kind))
        else:
            taken = 0 if m.get_type() == "MISSION_CLEAR_ALL" else 3
            self._channel.send(mavlink.MAVLink_mission_ack_message(*to, taken, kind))

    def _data_stream(self, m: Any) -> None:
        rate = float(m.req_message_rate) if m.start_stop else 0.0
        for number, *names in GROUPS.values():
            if m.req_stream_id in (0, number):
                for name in names:
                    self._channel.stream(str(name), rate)

    def _version(self, m: Any) -> None:
        a = self._a
        self._channel.send(MAKERS["AUTOPILOT_VERSION"](a))

    def _origin(self, m: Any) -> None:
        a = self._a
        if a.state.origin is None:
            latitude, longitude = m.latitude * 1e-7, m.longitude * 1e-7
            a.state.origin = Tangent.on_ellipsoid(latitude, longitude, m.altitude * 1e-3)
            self._channel.send(MAKERS["GPS_GLOBAL_ORIGIN"](a))

    def _override(self, m: Any) -> None:
        """Sticks from a ground station: only the one that the vehicle obeys counts."""
        a = self._a
        if m.get_srcSystem() != int(a.state.parameters.get("SYSID_MYGCS", m.get_srcSystem())):
            return
        pulses = (m.chan1_raw, m.chan2_raw, m.chan3_raw, m.chan4_raw)
        if any(pulse in (RELEASED, IGNORED) for pulse in pulses):
            a.state.sticks = None if RELEASED in pulses else a.state.sticks
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
