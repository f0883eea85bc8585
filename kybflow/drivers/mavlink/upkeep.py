"""What keeps a link with an autopilot alive: heartbeats, streams asked for, parameters read, clocks
compared, commands sent again. All of it comes from the tick, and stops with it.

There are two heartbeats: that of a ground station, for which alone PX4 says what is wrong, and that
of a computer on board. What an autopilot has forgotten since it started anew, or while nobody heard
it, is asked for again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.telemetry.clocks import TimeSync
from kybflow.drivers.mavlink.transport.router import HEARTBEAT, heartbeat

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.contact import Contact

STATION, ONBOARD = 190, 191
"""Our components."""
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 512, 511
ROUND: Time = 5 * NS
"""How long after its streams were asked for those that don't come are asked for again."""
ROUNDS = 3
SILENT: Time = 3 * NS


class Chores:
    """rates: the streams to ask for, Hz. names: the parameters to read. `sync`: the other way to
    compare clocks."""

    def __init__(self, contact: Contact, rates: Mapping[str, float], names: Sequence[str]) -> None:
        self.sync = TimeSync(contact.clock)
        self._port, self._heard, self._clock = contact.port, contact.heard, contact.clock
        self._requests, self._parameters = contact.requests, contact.parameters
        self._rates, self._names = dict(rates), names
        self._heartbeat: Time = 0
        self._round: Time = 0
        self._rounds = 0
        self._reboots = 0

    def stream(self, name: str, rate: float, now: Time) -> None:
        """Ask for another rate of a stream, Hz, where that is another."""
        is_other = rate != self._rates.get(name)
        self._rates[name] = rate
        if self._rounds and is_other:
            self._ask_for(name, now)

    def begin_anew(self) -> None:
        """It may have forgotten what it was asked for."""
        self._round = self._rounds = 0

    def step(self, now: Time) -> None:
        """Once a tick. Raises DriverError."""
        if now >= self._heartbeat:
            self._heartbeat = now + NS
            self._port.send(HEARTBEAT, STATION)
            self._port.send(heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER), ONBOARD)
        if self._heard.heartbeat is None:
            return
        if self._clock.reboots != self._reboots:
            self._reboots = self._clock.reboots
            self._heard.at.pop("GPS_GLOBAL_ORIGIN", None)
            self._parameters.read(self._names, now, again=True)
            self.begin_anew()
        if self._rounds < ROUNDS and now >= self._round:
            self._ask(now)
        for due in (self._requests, self._parameters, self.sync):
            for message in due.due(now):
                self._port.send(message)

    def _ask(self, now: Time) -> None:
        if self._rounds == 0:
            self._parameters.read(self._names, now)
        self._rounds += 1
        self._round = now + ROUND
        for name in self._rates:
            if self._rounds == 1 or now - self._heard.at.get(name, -SILENT) >= SILENT:
                self._ask_for(name, now)
        if "GPS_GLOBAL_ORIGIN" not in self._heard.at:
            number = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
            self._requests.ask(REQUEST_MESSAGE, number, now=now, attempts=2)

    def _ask_for(self, name: str, now: Time) -> None:
        number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        interval = round(1e6 / self._rates[name])
        self._requests.ask(SET_MESSAGE_INTERVAL, number, interval, now=now, attempts=3)
