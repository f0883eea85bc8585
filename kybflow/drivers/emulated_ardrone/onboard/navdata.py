"""The navigation data that an emulated drone sends.

In bootstrap it sends only the state mask. After that it sends the options of the demo mode at 15
Hz, or those that `general:navdata_options` selects at 200 Hz, by default all. Options that are not
emulated are zeros of the right size.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.navdata.layouts import LAYOUTS, OptionTag
from kybflow.drivers.ardrone.protocol.navdata.options import (
    PhysMeasures,
    write_demo,
    write_phys_measures,
    write_raw_measures,
    write_time,
)
from kybflow.drivers.ardrone.protocol.navdata.packet import write_packet
from kybflow.drivers.emulated_ardrone.onboard.drone import OnboardDrone

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
        period = NS // (DEMO if is_demo or drone.is_in_bootstrap else FULL)
        while self._due <= now and len(packets) < 2:
            self._due += period
            self._sequence += 1
            options = [] if drone.is_in_bootstrap else [*self._options(is_demo, now)]
            packets.append(write_packet(drone.state(), self._sequence, options))
        if self._due <= now:
            self._due = now + period
        return packets

    def _options(self, is_demo: bool, now: Time) -> Iterator[tuple[int, bytes]]:
        asked = int(self._drone.configuration.number("general:navdata_options"))
        if asked == SMALL and not is_demo:
            asked = -1
        asked = SMALL if is_demo else asked | 1
        for tag, size in SIZES.items():
            if asked & 1 << tag:
                yield self._option(tag, now) or (tag, bytes(size))

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
