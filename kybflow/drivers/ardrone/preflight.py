"""Preflight checks of a drone."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.control.configuring import (
    LONGEST_WATCHDOG,
    VERSION,
    WATCHDOG,
    Configuring,
)
from kybflow.drivers.ardrone.control.moves import Limits
from kybflow.drivers.ardrone.control.round_trips import RoundTrips
from kybflow.drivers.ardrone.protocol.navdata.state import DroneState, in_words
from kybflow.drivers.ardrone.telemetry.status import DroneStatus
from kybflow.parts import Check
from kybflow.world.vehicle_context import Airframe

FRESH: Time = NS // 2
LATER = 0.15
"""Seconds by which a round trip may exceed the delay for which the gains are designed."""
FIRMWARE = "2."
"""Prefix of an AR.Drone 2.0's firmware version."""


def checks(
    status: DroneStatus,
    configuring: Configuring,
    limits: Limits,
    airframe: Airframe,
    trouble: str,
    now: Time,
) -> Iterator[Check]:
    if status.last_received is None:
        yield Check("navdata", False, trouble or "none has arrived")
        return
    age = now - status.last_received
    yield Check("navdata", age < FRESH, f"{age / NS:.1f} s old")
    emergency = "; ".join(in_words(status.state)) if status.is_in_emergency else ""
    yield Check("emergency", not emergency, emergency or "none")
    low = DroneState.BATTERY_LOW in status.state
    charge = "unknown" if status.demo is None else f"{status.demo.battery} %"
    yield Check("own battery", not low, f"{charge}{', which it reports as low' if low else ''}")
    waits = configuring.pending
    wrong = "" if waits else "; ".join(configuring.mismatches)
    yield Check("configuration", not (waits or wrong), waits or wrong or "as written")
    found = configuring.found or {}
    version = found.get(VERSION, "unknown")
    yield Check("firmware", version.startswith(FIRMWARE), version)
    yield _watchdog(found.get(WATCHDOG))
    fits = limits.tilt >= airframe.tilt - 1e-6
    reason = f"{degrees(limits.tilt):.0f} deg, of which a command is a fraction"
    if not fits:
        most = degrees(airframe.tilt)
        reason += f"; the airframe's tilt is {most:.0f} deg: give it or `euler_angle_max`"
    yield Check("tilt", fits, reason, waits=False)


def _watchdog(found: str | None) -> Check:
    """Return the check that the drone lands soon after commands stop. found: the configured
    timeout, seconds."""
    try:
        seconds = float(found) if found is not None else None
    except ValueError:
        seconds = None
    if seconds is None:
        return Check("watchdog", False, f"`{WATCHDOG}` is not known")
    good = 0.0 < seconds <= LONGEST_WATCHDOG
    words = f"it lands {seconds:g} s after the last command"
    return Check("watchdog", good, words if good else f"{words}; {LONGEST_WATCHDOG:g} s at most")


def round_trip(trips: RoundTrips, latency: float, now: Time) -> Check:
    """Return the check that a round trip takes little longer than the delay for which the gains are
    designed. latency: this delay, seconds."""
    if trips.waits(now):
        return Check("round trip", False, "no command is acknowledged yet")
    if not trips.delay:
        return Check("round trip", True, "unknown, so that `link_slow` is never raised")
    words = f"a command and its answer take {trips.delay:.2f} s"
    good = trips.delay <= latency + LATER
    late = f"{words}, {latency + LATER:.2f} s at most with `latency: {latency:g} s`"
    return Check("round trip", good, words if good else late)
