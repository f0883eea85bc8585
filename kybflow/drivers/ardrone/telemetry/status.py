"""The latest status of one drone, and messages about its changes."""

from __future__ import annotations

from kybflow.core.signals import Time
from kybflow.drivers.ardrone.protocol.navdata.options import Demo, demo
from kybflow.drivers.ardrone.protocol.navdata.packet import Packet
from kybflow.drivers.ardrone.protocol.navdata.state import (
    ALARMS,
    FOLLOWING,
    DroneState,
    Phase,
    in_words,
)
from kybflow.parts import StatusText

WARNINGS = frozenset({DroneState.BATTERY_LOW, DroneState.USER_EMERGENCY})
"""The alarms that are reported as warnings only."""
MOST_TEXTS = 100
"""Largest number of unread texts."""


class DroneStatus:
    """The status of one drone.

    state: the latest state mask. demo: the latest demo option, None before the first.
    last_received: when the latest packet arrived.
    """

    def __init__(self) -> None:
        self.state = DroneState(0)
        self.demo: Demo | None = None
        self.last_received: Time | None = None
        self._texts: list[StatusText] = []

    def receive(self, packet: Packet, now: Time) -> None:
        begun = packet.state & ~self.state
        self.state, self.last_received = packet.state, now
        self.demo = demo(packet.options) or self.demo
        for bit in ALARMS:
            if begun & bit and len(self._texts) < MOST_TEXTS:
                severity = "warning" if bit in WARNINGS else "critical"
                self._texts.append(StatusText(severity, in_words(bit)[0]))

    def texts(self) -> list[StatusText]:
        """Return the messages added since the last call."""
        texts, self._texts = self._texts, []
        return texts

    @property
    def phase(self) -> Phase:
        return Phase.DEFAULT if self.demo is None else self.demo.phase

    @property
    def flies(self) -> bool:
        """Whether the drone is in the air, is taking off or is landing."""
        return DroneState.FLYING in self.state

    @property
    def follows(self) -> bool:
        """Whether the drone follows moves."""
        return self.flies and self.phase in FOLLOWING

    @property
    def stands(self) -> bool:
        """Whether the drone is on the ground with its rotors stopped."""
        return not self.flies

    @property
    def is_in_emergency(self) -> bool:
        return DroneState.EMERGENCY in self.state

    @property
    def acknowledges(self) -> bool:
        """Whether the drone has applied a configuration value and waits for the acknowledge bit to
        be reset."""
        return DroneState.COMMAND_ACKNOWLEDGED in self.state
