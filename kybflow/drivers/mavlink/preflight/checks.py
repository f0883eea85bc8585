"""The preflight checks of an autopilot and of its serial line, with the autopilot's texts.

An autopilot reports its readiness only for its current mode, so a disarmed vehicle is first put
into the mode in which it follows setpoints. If it stays unready, it is requested to run its own
checks, because not every autopilot reports unasked what is wrong. Unhealthy sensors are named along
with its texts.

A serial line of B baud carries B / 10 bytes a second each way. The autopilot's streams get half of
that: they are all slowed by the same factor, but not below once a second. The other half is for
parameters, replies and texts, and for radios that send in only one direction at a time. Setpoints
and poses are not slowed; if they don't fit, the check fails. Other kinds of connection count as
fast enough."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Estimate, Time
from kybflow.drivers.mavlink.control.requests import Modes
from kybflow.drivers.mavlink.firmware import firmware_by
from kybflow.drivers.mavlink.preflight.required_parameters import RequiredParameters
from kybflow.drivers.mavlink.protocol.framing import LAYOUTS, NUMBERS, mavlink
from kybflow.drivers.mavlink.protocol.signing import SIGNATURE
from kybflow.drivers.mavlink.transport.wire import read_address
from kybflow.parts import Check

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.autopilot_state import AutopilotState
    from kybflow.drivers.mavlink.params import MavlinkParams

ALIVE: Time = 3 * NS
REPEATED: Time = 35 * NS
"""How long a text about arming counts; autopilots repeat it every 30 s."""
UNREADY: Time = 3 * NS
"""How long an autopilot may be unready before its own checks are requested."""
AGAIN: Time = 10 * NS
"""The pause between two such requests."""
APART = 0.5
"""The largest allowed distance between the autopilot's position and ours, metres."""


class PreflightChecks:
    """The preflight checks of one autopilot. params: the driver's parameters in the mission."""

    def __init__(self, autopilot: AutopilotState, modes: Modes, params: MavlinkParams) -> None:
        self._profile, self._status, self._modes = autopilot.profile, autopilot.status, modes
        self._state = autopilot
        self._telemetry, self._requests = autopilot.telemetry, autopilot.requests
        self._is_outside = autopilot.is_outside
        self._required = RequiredParameters(autopilot, params)
        self._checks_at: Time | None = None

    def names(self) -> list[str]:
        """Return the names of the parameters to read."""
        return self._required.names()

    def checks(self, misses: str, sent: tuple[Estimate, Time] | None, now: Time) -> list[Check]:
        """Return the current checks. misses: why the mode that follows setpoints is not in force,
        empty if it is. sent: the last estimate sent to the autopilot, and the time of sending."""
        heartbeat = self._heartbeat(now)
        if not heartbeat.green:
            unknown = "not known: its parameters are read once its heartbeat is right"
            return [heartbeat, Check("watchdog", False, unknown)]
        lines = [heartbeat, self._required.watchdog()]
        if self._is_outside:
            lines.append(self._required.set_up())
        misses = misses and misses + self._state.ignored_because
        lines.append(Check("command mode", not misses, misses or self._modes.reported))
        return [*lines, self._position(sent, now), self._autopilot(now)]

    def _heartbeat(self, now: Time) -> Check:
        status, wanted = self._status, self._profile.name
        if status.heartbeat is None:
            return Check("heartbeat", False, "none was received")
        age = (now - status.heartbeat) / NS
        if now - status.heartbeat > ALIVE:
            return Check("heartbeat", False, f"the last one {age:.1f} s ago")
        maker = firmware_by(status.autopilot) or f"autopilot {status.autopilot}"
        if maker != wanted:
            way_out = "set the driver's `autopilot`, or `system`"
            reason = f"it is {maker}, {wanted} is expected: {way_out}"
            return Check("heartbeat", False, reason, waits=False)
        return Check("heartbeat", True, f"{maker} in {self._modes.reported}, {age:.1f} s ago")

    def _position(self, sent: tuple[Estimate, Time] | None, now: Time) -> Check:
        own, spread = self._telemetry.odometry, self._telemetry.spread
        if self._is_outside and (sent is None or now - sent[1] > NS):
            return Check("position", False, "there is no estimate to send")
        if spread is None:
            flags = f"it has none (estimator flags {self._status.ekf})"
            return Check("position", False, f"{flags}; {self._required.fed()}")
        if own is None:
            return Check("position", False, "it reports none yet")
        if self._is_outside and sent is not None:
            apart = distance(own.position, sent[0].position)
            reason = f"{apart:.2f} m from the one that kybflow sends ({APART:.2f} m allowed)"
            return Check("position", apart <= APART, reason)
        return Check("position", True, f"spread {spread:.2f} m")

    def _autopilot(self, now: Time) -> Check:
        status = self._status
        if status.armed:
            reason = f"it is armed already, in {self._modes.reported}"
            return Check("autopilot", False, reason, waits=False)
        unready = self._profile.ready(status)
        if unready is None:
            self._checks_at = None
            return Check("autopilot", True, "ready to arm")
        self._request_checks(now)
        words = status.words(max(now - REPEATED, 0))
        reason = f"{unready}: {words}" if words else unready
        return Check(
            "autopilot", False, f"{reason}; {status.unhealthy}" if status.unhealthy else reason
        )

    def _request_checks(self, now: Time) -> None:
        """Request the autopilot's own checks, so that it reports what is wrong."""
        if self._checks_at is None:
            self._checks_at = now + UNREADY
        elif now >= self._checks_at:
            self._checks_at = now + AGAIN
            self._requests.ask(mavlink.MAV_CMD_RUN_PREARM_CHECKS, now=now)


BITS = 10
HEAD = 12
"""The bytes of a frame apart from its fields and its signature."""
STREAMS, OURS = 0.5, 0.8
"""The fraction of a line's capacity for the streams, and the largest fraction that our messages may
take."""
SLOWEST = 1.0
"""The rate, Hz, below which streams are not slowed."""


class LineCapacity:
    """The serial line to one vehicle. line: its capacity each way, bytes per second; None for
    connections that are fast enough. params: the driver's parameters in the mission."""

    def __init__(self, params: MavlinkParams) -> None:
        place = None if params.address is None else read_address(params.address)
        is_serial = place is not None and place.kind == "serial"
        self.line = place.number / BITS if place is not None and is_serial else None
        self._params = params
        self._head = HEAD + (0 if params.key is None else SIGNATURE)

    def fitting(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Return these stream rates, Hz, slowed to what the line carries."""
        if self.line is None:
            return dict(rates)
        factor = min(1.0, STREAMS * self.line / self._load(rates))
        return {name: min(rate, max(factor * rate, SLOWEST)) for name, rate in rates.items()}

    def check(self) -> list[Check]:
        """Return the preflight check of the line; none for a connection that is fast enough."""
        if self.line is None:
            return []
        params = self._params
        sent, way_out = {"SET_POSITION_TARGET_LOCAL_NED": params.rate}, "a lower `rate`"
        if params.position == "outside":
            sent["ODOMETRY"], way_out = params.vision_rate, "a lower `rate` and `vision_rate`"
        load = self._load(sent)
        found = f"{load:.0f} bytes a second are sent to it, the line carries {self.line:.0f}"
        if load <= OURS * self.line:
            return [Check("serial line", True, found)]
        way_out = f"set {way_out}, or a higher baud rate on both sides"
        return [Check("serial line", False, f"{found}: {way_out}", waits=False)]

    def _load(self, rates: Mapping[str, float]) -> float:
        """Return the load of these streams, bytes per second."""
        sizes = {name: int(LAYOUTS[NUMBERS[name]].size) for name in rates if name in NUMBERS}
        return sum(rates[name] * (self._head + size) for name, size in sizes.items())
