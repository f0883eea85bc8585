"""An emulated drone on its radio link: it receives datagrams, makes a step, and sends what is due.

The radio link has delay, jitter and loss, but never reorders datagrams. In bootstrap the drone
sends only the state mask. After that it sends the options of the demo mode at 15 Hz, or those that
`general:navdata_options` selects at 200 Hz, by default all. Options that are not emulated are zeros
of the right size.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Hashable, Iterable
from math import degrees
from typing import Generic, NamedTuple, TypeVar

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import NS, Measurement, Time
from kybflow.drivers.ardrone.at import write_configuration
from kybflow.drivers.ardrone.navdata import (
    LAYOUTS,
    OptionTag,
    PhysMeasures,
    write_demo,
    write_packet,
    write_phys_measures,
    write_raw_measures,
    write_time,
)
from kybflow.drivers.emulated_ardrone.drone import DroneFailures, OnboardDrone
from kybflow.drivers.emulated_ardrone.ports import Ports
from kybflow.drivers.emulated_ardrone.video import DroneVideo
from kybflow.drivers.emulation.breaking import BreakableLink

DEMO, FULL = 15, 200
SMALL = 1 << OptionTag.DEMO | 1 << OptionTag.VISION_DETECT
"""The default options. At 200 Hz they select all options."""
SIZES = {
    OptionTag(tag): fields[-1].at + fields[-1].layout.size
    for tag, fields in LAYOUTS.items()
    if tag != OptionTag.GPS
}
SIZES[OptionTag.DEMO], SIZES[OptionTag.REFERENCES] = 144, 84


class NavdataSender:
    """Makes the packets of one drone. wanted: whether a client has requested them."""

    def __init__(self, drone: OnboardDrone) -> None:
        self._drone = drone
        self.wanted = False
        self._sequence = 0
        self._due: Time = 0

    def begin(self, now: Time) -> None:
        """Send packets from now on, the first at once."""
        if not self.wanted:
            self.wanted, self._sequence, self._due = True, 0, now

    def end(self) -> None:
        """Stop sending, because the communication is lost."""
        self.wanted = False

    def due(self, now: Time) -> list[bytes]:
        if not self.wanted:
            return []
        drone, packets = self._drone, list[bytes]()
        is_demo = drone.configuration.truth("general:navdata_demo")
        asked = int(drone.configuration.number("general:navdata_options"))
        wanted = SMALL if is_demo else -1 if asked == SMALL else asked | 1
        period = NS // (DEMO if is_demo or drone.is_in_bootstrap else FULL)
        while self._due <= now and len(packets) < 2:
            self._due += period
            self._sequence += 1
            options = [
                self._option(tag, now) or (tag, bytes(size))
                for tag, size in SIZES.items()
                if wanted & 1 << tag and not drone.is_in_bootstrap
            ]
            packets.append(write_packet(drone.state(), self._sequence, options))
        if self._due <= now:
            self._due = now + period
        return packets

    def _option(self, tag: OptionTag, now: Time) -> tuple[int, bytes] | None:
        drone = self._drone
        if tag is OptionTag.DEMO:
            return write_demo(drone.demo(), frame=self._sequence)
        if tag is OptionTag.TIME:
            return write_time(now // 1000)
        if tag is OptionTag.RAW_MEASURES:
            return write_raw_measures(round(1000.0 * drone.battery.voltage))
        imu = drone.estimator.imu
        if tag is OptionTag.PHYS_MEASURES and imu is not None:
            unit, (x, y, z) = 1000.0 / GRAVITY, imu.specific_force
            gx, gy, gz = map(degrees, imu.angular_velocity)
            return write_phys_measures(
                PhysMeasures((unit * x, -unit * y, -unit * z), (gx, -gy, -gz))
            )
        return None


T = TypeVar("T")


class Radio(NamedTuple):
    """The properties of a radio link. latency: delay of a datagram, s. jitter: largest deviation
    from this delay, s, uniformly distributed. loss: share of datagrams that are lost."""

    latency: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0


class DelayLine(Generic[T]):
    """One direction of a radio link. more: additional delay, ns, set by a fault."""

    more: Time = 0

    def __init__(self, radio: Radio, generator: random.Random) -> None:
        self._radio, self._generator = radio, generator
        self._on_the_way: deque[tuple[Time, T]] = deque()
        self._last: Time = 0

    def send_all(self, messages: Iterable[T], now: Time) -> None:
        latency, jitter, loss = self._radio
        for message in messages:
            if loss > 0.0 and self._generator.random() < loss:
                continue
            late = latency + jitter * (2.0 * self._generator.random() - 1.0)
            self._last = max(self._last, now + self.more + round(max(0.0, late) * NS))
            self._on_the_way.append((self._last, message))

    def arrived(self, now: Time) -> list[T]:
        """Return the messages that have arrived since the last call."""
        found = []
        while self._on_the_way and self._on_the_way[0][0] <= now:
            found.append(self._on_the_way.popleft()[1])
        return found


Received = tuple[bytes, Hashable]


class DroneEndpoint:
    """One drone and its ports. generator: draws the radio's delays and losses. video: the drone's
    video; None without video. on_phase: called with the time (s) and the flight phase whenever the
    phase changes."""

    on_phase: Callable[[float, str], None] | None = None
    video: DroneVideo | None = None

    def __init__(self, drone: OnboardDrone, radio: Radio, generator: random.Random) -> None:
        self.drone = drone
        self.navdata = NavdataSender(drone)
        self._ports: Ports | None = None
        self._link = BreakableLink(drone.failures, generator)
        self._commands: DelayLine[Received] = DelayLine(radio, generator)
        self._requests: DelayLine[Received] = DelayLine(radio, generator)
        self._data: DelayLine[bytes] = DelayLine(radio, generator)
        drone.on_configuration = self._send_configuration

    @property
    def failures(self) -> DroneFailures:
        return self.drone.failures

    def connect(self, ports: Ports) -> None:
        self._ports = ports

    def set_delay(self, late: Time) -> None:
        """Delay commands by `late` beyond the radio's delay."""
        self._commands.more = late

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        self.drone.add_measurement(measured, now)

    def step(self, now: Time) -> None:
        """Make one step: receive, estimate, fly and send."""
        ports, was, was_lost = self._ports, self.drone.flight.phase, self.drone.is_lost
        if ports is not None:
            self._commands.send_all(self._link.received(ports.commands()), now)
            self._requests.send_all(self._link.received(ports.requests()), now)
            for datagram, sender in self._commands.arrived(now):
                self.drone.receive(datagram, sender, now)
            for _, sender in self._requests.arrived(now):
                if ports.answer(sender):
                    self.navdata.begin(now)
        self.drone.step(now)
        if self.on_phase is not None and self.drone.flight.phase is not was:
            self.on_phase(now / NS, self.drone.flight.phase.name.lower().replace("_", " "))
        if self.drone.is_lost and not was_lost:
            self._send(now)
            self.navdata.end()
        self._send(now)

    def _send(self, now: Time) -> None:
        if self._ports is None:
            return
        packets = self.navdata.due(now)
        self._data.send_all((data for data in packets if self._link.sends()), now)
        for data in self._data.arrived(now):
            self._ports.send(data)
        if self.video is not None and self._ports.is_watched:
            self._ports.send_video(self.video.due(now))

    def _send_configuration(self) -> None:
        if self._ports is not None:
            self._ports.send_configuration(write_configuration(self.drone.configuration.values))
