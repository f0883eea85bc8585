"""The auxiliary outputs of an emulated autopilot.

Pulses are in microseconds; a servo is open at pulses below `MIDDLE`.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.signals import Time
from kybflow.drivers.emulated_autopilot.state import EmulatedState
from kybflow.drivers.mavlink.protocol.framing import mavlink

MIDDLE = 1500
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED
FAILED: int = mavlink.MAV_RESULT_FAILED
COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_SERVO, mavlink.MAV_CMD_DO_SET_RELAY,
        mavlink.MAV_CMD_DO_SET_ACTUATOR, mavlink.MAV_CMD_DO_GRIPPER,
    }
)  # fmt: skip


class Outputs:
    """The outputs of one vehicle. Its attribute `pulses` holds the current pulses by channel.

    channel: the channel of the payload's servo, None without one.
    pulses: the pulses of an open and of a closed servo.
    closed: whether the payload's servo is closed at first.
    move: opens or closes the payload's servo.
    """

    def __init__(
        self,
        state: EmulatedState,
        channel: int | None,
        pulses: tuple[int, int],
        closed: bool,
        move: Callable[[bool, Time], None],
    ) -> None:
        self.state, self._channel, self._move = state, channel, move
        self.pulses: dict[int, int] = {}
        if channel is not None:
            self.pulses[channel] = pulses[closed]

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
