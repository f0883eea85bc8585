"""The auxiliary outputs of an emulated autopilot.

Pulses are in microseconds; below the middle a servo is open.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.signals import Time
from kybflow.drivers.emulated_autopilot.state import EmulatedState
from kybflow.drivers.mavlink.protocol.dialect import mavlink

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
    """The outputs of one vehicle.

    `pulses`: by channel, from 5. channel: the one that holds the payload, None without one. pulses:
    of an open and a closed servo. move: opens or closes the payload's servo.
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
        """Move all outputs with that function; returns whether there is one. parameter: the name of
        the parameter with an output's function, `{}` in place of its number."""
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
