"""What one drone last said of itself, and what it says in words when that changes."""

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

QUIET = frozenset({DroneState.BATTERY_LOW, DroneState.USER_EMERGENCY})
"""What is no more than a warning."""
KNOWN = 100
"""How many texts wait to be read."""


class DroneStatus:
    """The status of one drone.

    `state`: the newest mask. `demo`: the newest demo option, None before one came. `heard`: when
    something last arrived.
    """

    def __init__(self) -> None:
        self.state = DroneState(0)
        self.demo: Demo | None = None
        self.heard: Time | None = None
        self._texts: list[StatusText] = []

    def hear(self, packet: Packet, now: Time) -> None:
        """Take in one packet."""
        begun = packet.state & ~self.state
        self.state, self.heard = packet.state, now
        self.demo = demo(packet.options) or self.demo
        for bit in ALARMS:
            if begun & bit and len(self._texts) < KNOWN:
                severity = "warning" if bit in QUIET else "critical"
                self._texts.append(StatusText(severity, in_words(bit)[0]))

    def texts(self) -> list[StatusText]:
        """What it said since the last call."""
        texts, self._texts = self._texts, []
        return texts

    @property
    def phase(self) -> Phase:
        """Its state of flight."""
        return Phase.DEFAULT if self.demo is None else self.demo.phase

    @property
    def flies(self) -> bool:
        """Whether it is in the air, or on its way up or down."""
        return DroneState.FLYING in self.state

    @property
    def follows(self) -> bool:
        """Whether it follows moves."""
        return self.flies and self.phase in FOLLOWING

    @property
    def stands(self) -> bool:
        """Whether it is on the ground with its rotors at rest."""
        return not self.flies

    @property
    def is_in_emergency(self) -> bool:
        return DroneState.EMERGENCY in self.state

    @property
    def acknowledges(self) -> bool:
        """Whether it has taken a configuration and waits for the bit to be reset."""
        return DroneState.COMMAND_ACKNOWLEDGED in self.state
