"""The commands of an emulated autopilot, COMMAND_LONG and COMMAND_INT, with the acknowledgements
that the firmwares were seen to give."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.control import payload
from kybflow.drivers.emulated_autopilot.messages.channel import Channel, name_of
from kybflow.drivers.emulated_autopilot.messages.telemetry import MAKERS
from kybflow.drivers.emulated_autopilot.state import CRITICAL, Role
from kybflow.drivers.mavlink.protocol.dialect import mavlink

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
FORCED = 21196
"""The second parameter of an arming or disarming that must not be refused."""
CUSTOM = 1
"""Bit of a base mode: the custom mode counts."""

Params = tuple[float, ...]


class CommandHandlers:
    """The handlers of one channel's commands."""

    def __init__(self, autopilot: OnboardAutopilot, channel: Channel) -> None:
        self._a, self._channel = autopilot, channel
        self._actions: dict[int, Callable[[Params], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: self._land,
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._return,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._loiter,
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE: self._pause,
            mavlink.MAV_CMD_DO_SET_HOME: self._set_home,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._capabilities,
        }

    def obey(self, message: Any) -> int:
        """Carry out a COMMAND_LONG or COMMAND_INT; its acknowledgement."""
        m, number = message, message.command
        if m.get_type() == "COMMAND_INT":
            p: Params = (m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z)
        else:
            p = (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
        if number in payload.COMMANDS:
            return self._a.firmware.move_output(self._a.outputs, number, p, self._a.now)
        action = self._actions.get(number)
        return UNSUPPORTED if action is None else action(p)

    def set_mode(self, number: int) -> int:
        """Change to a mode, or say why not; the acknowledgement."""
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

    def _arm(self, p: Params) -> int:
        a = self._a
        state, forced = a.state, p[1] == FORCED
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
        a.change(self._mode(Role.TAKE_OFF), a.now, asked=True)
        state.climb_to = low if sea is None or not isfinite(sea) else max(sea, here + 0.5)
        return ACCEPTED

    def _land(self, p: Params) -> int:
        a = self._a
        return self.set_mode(a.firmware.land)

    def _return(self, p: Params) -> int:
        a = self._a
        return self.set_mode(a.firmware.back)

    def _loiter(self, p: Params) -> int:
        a = self._a
        return self.set_mode(a.firmware.hold)

    def _pause(self, p: Params) -> int:
        """Hold where it is: in its mode, or by changing to the mode that holds."""
        a = self._a
        if p[0] != 0.0:
            return ACCEPTED
        if not a.firmware.pauses_in_mode:
            return self.set_mode(a.firmware.hold)
        a.state.wanted = None
        a.flight.enter(a.now)
        return ACCEPTED

    def _set_home(self, p: Params) -> int:
        a = self._a
        if a.state.origin is None:
            return a.firmware.denied
        a.state.home = a.state.estimator.position
        return ACCEPTED

    def _mode(self, role: Role) -> int:
        return next(number for number, mode in self._a.firmware.modes.items() if mode.role is role)

    def _set_interval(self, p: Params) -> int:
        name, channel = name_of(int(p[0])), self._channel
        if name not in MAKERS or name in self._a.firmware.profile.polled:
            return DENIED
        usual = channel.usual(name)
        channel.stream(name, usual if p[1] == 0.0 else 0.0 if p[1] < 0.0 else 1e6 / p[1])
        return ACCEPTED

    def _get_interval(self, p: Params) -> int:
        apart = round(1e6 * self._channel.interval(name_of(int(p[0])))) or -1
        self._channel.send(mavlink.MAVLink_message_interval_message(int(p[0]), apart))
        return ACCEPTED

    def _request(self, p: Params) -> int:
        maker = MAKERS.get(name_of(int(p[0])))
        if maker is None:
            return DENIED
        message = maker(self._a)
        if message is None:
            return FAILED
        self._channel.send(message)
        return ACCEPTED

    def _capabilities(self, p: Params) -> int:
        self._channel.send(MAKERS["AUTOPILOT_VERSION"](self._a))
        return ACCEPTED
