"""The outputs of an emulated autopilot beside its motors, and the commands that move them, as the
firmwares were seen to take them. Pulses in microseconds; below the middle a servo is open."""

from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.errors import Refused
from kybflow.core.signals import Time
from kybflow.drivers.emulated_autopilot.state import INFO, State

MIDDLE = 1500
GRIPPER, FIRST_SET, SETS = 430, 301, 6
AP_GRIPPER, AP_RELAY, AP_FIRST_RELAY = 28, -1, 9
ACCEPTED, UNSUPPORTED, FAILED, DENIED = 0, 3, 4, 2
COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_SERVO, mavlink.MAV_CMD_DO_SET_RELAY,
        mavlink.MAV_CMD_DO_SET_ACTUATOR, mavlink.MAV_CMD_DO_GRIPPER,
    }
)  # fmt: skip


class Outputs:
    """`pulses` by channel, from 5. channel: the one that holds the payload, None without one.
    move: opens or closes it."""

    def __init__(
        self, state: State, channel: int | None, closed: bool, move: Callable[[bool, Time], None]
    ) -> None:
        self._state, self._channel, self._move = state, channel, move
        self._px4 = state.firmware.name == "px4"
        self.pulses: dict[int, int] = {}
        if channel is not None:
            high, low = (2000, 1000) if self._px4 else (1900, 1100)
            self.pulses[channel] = high if closed else low

    def command(self, number: int, p: tuple[float, ...], now: Time) -> int:
        """Obey one of `COMMANDS`; what it is acknowledged with."""
        if self._px4:
            return self._of_px4(number, p, now)
        return self._of_ardupilot(number, p, now)

    def _of_px4(self, number: int, p: tuple[float, ...], now: Time) -> int:
        if number == mavlink.MAV_CMD_DO_GRIPPER:
            self._functions("PWM_MAIN_FUNC", GRIPPER, 2000 if p[1] else 1000, now)
            return ACCEPTED
        if number != mavlink.MAV_CMD_DO_SET_ACTUATOR:
            return UNSUPPORTED
        for place in range(SETS):
            if p[place] == p[place]:
                pulse = round(1500.0 + 500.0 * max(-1.0, min(1.0, p[place])))
                self._functions("PWM_MAIN_FUNC", FIRST_SET + place, pulse, now)
        return ACCEPTED

    def _of_ardupilot(self, number: int, p: tuple[float, ...], now: Time) -> int:
        parameters = self._state.parameters
        if number == mavlink.MAV_CMD_DO_SET_SERVO:
            if parameters.get(f"SERVO{int(p[0])}_FUNCTION", -2.0) != 0.0:
                return FAILED
            self._set(int(p[0]), round(p[1]), now)
            return ACCEPTED
        if number == mavlink.MAV_CMD_DO_SET_RELAY:
            channel = AP_FIRST_RELAY + int(p[0])
            if parameters.get(f"SERVO{channel}_FUNCTION") != AP_RELAY:
                return FAILED
            self._set(channel, 1900 if p[1] else 1100, now)
            return ACCEPTED
        if number != mavlink.MAV_CMD_DO_GRIPPER:
            return UNSUPPORTED
        if parameters["GRIP_ENABLE"] != 1 or parameters["GRIP_TYPE"] != 1:
            return FAILED
        pulse = parameters["GRIP_GRAB"] if p[1] else parameters["GRIP_RELEASE"]
        if not self._functions("SERVO", AP_GRIPPER, round(pulse), now, "_FUNCTION"):
            return FAILED
        self._state.say("Gripper load grabbed" if p[1] else "Gripper load released", INFO)
        return ACCEPTED

    def _functions(
        self, prefix: str, function: int, pulse: int, now: Time, suffix: str = ""
    ) -> bool:
        """Move all outputs with a function; PX4's don't move while it is not armed."""
        found = [
            channel
            for channel in range(1, 15)
            if self._state.parameters.get(f"{prefix}{channel}{suffix}") == function
        ]
        if self._state.armed or not self._px4:
            for channel in found:
                self._set(channel, pulse, now)
        return bool(found)

    def _set(self, channel: int, pulse: int, now: Time) -> None:
        before, self.pulses[channel] = self.pulses.get(channel), pulse
        if channel != self._channel or before is None:
            return
        if (before < MIDDLE) != (pulse < MIDDLE):
            try:
                self._move(pulse < MIDDLE, now)
            except Refused:
                self.pulses[channel] = before
