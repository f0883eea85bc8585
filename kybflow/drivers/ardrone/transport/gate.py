"""Which datagrams are taken for navigation data of our drone: those from its address, whole, and
newer than the last. All others are counted and dropped."""

from __future__ import annotations

from collections import Counter

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.navdata.packet import Malformed, Packet, read_packet

RESTARTS: Time = NS
"""After so long a silence the numbers may begin anew: the drone has started again."""


class Gate:
    """Admits the packets of one drone. `refused`: how many were not, by reason."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self._last = 0
        self._heard: Time | None = None

    def admit(self, data: bytes, is_ours: bool, now: Time) -> Packet | None:
        """The packet, None where it is none. is_ours: it came from the drone's address and port."""
        if not is_ours:
            self.refused["from elsewhere"] += 1
            return None
        try:
            packet = read_packet(data)
        except Malformed as error:
            self.refused[str(error)] += 1
            return None
        is_silent = self._heard is None or now - self._heard > RESTARTS
        if packet.sequence <= self._last and not is_silent:
            self.refused["not newer"] += 1
            return None
        self._last, self._heard = packet.sequence, now
        return packet

    def begin_anew(self) -> None:
        """Let the numbers begin anew, as after the communication's watchdog."""
        self._last = 0
