"""What the preflight asks of an autopilot, in its own words where it has any.

What it says of its readiness is about the mode that it is in, so a disarmed vehicle is put into the
mode in which it follows first. One that stays unready is asked to look at itself, for not every one
says what is wrong unasked; what it reports as not well is named beside its words. Its parameters
are looked at in `demands`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Estimate, Time
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.preflight.demands import Demands
from kybflow.parts import Check

if TYPE_CHECKING:
    from kybflow.drivers.mavlink import MavlinkParams
    from kybflow.drivers.mavlink.contact import Contact

ALIVE: Time = 3 * NS
REPEATED: Time = 35 * NS
"""How long what keeps it from arming counts: it is repeated every 30 s."""
RUN_PREARM_CHECKS = 401
UNREADY: Time = 3 * NS
"""How long it is unready before it is asked why."""
AGAIN: Time = 10 * NS
"""After this it is asked anew."""
APART = 0.5
"""Metres that it may be from where it is told to be."""
MAKERS = {3: "ardupilot", 12: "px4"}
"""MAV_AUTOPILOT."""


class Watch:
    """params: how the mission has it."""

    def __init__(self, contact: Contact, modes: Modes, params: MavlinkParams) -> None:
        self._profile, self._heard, self._modes = contact.profile, contact.heard, modes
        self._contact = contact
        self._telemetry, self._requests = contact.telemetry, contact.requests
        self._is_outside = contact.is_outside
        self._demands = Demands(contact, params)
        self._asks: Time | None = None

    def names(self) -> list[str]:
        """The parameters that are looked at."""
        return self._demands.names()

    def checks(self, misses: str, told: tuple[Estimate, Time] | None, now: Time) -> list[Check]:
        """misses: why it is not in the mode in which it follows, empty where it is. told: where it
        was told to be, and when, last."""
        heartbeat = self._heartbeat(now)
        if not heartbeat.green:
            unknown = "not known: its parameters are asked for once its heartbeat is right"
            return [heartbeat, Check("watchdog", False, unknown)]
        lines = [heartbeat, self._demands.watchdog()]
        if self._is_outside:
            lines.append(self._demands.set_up())
        misses = misses and misses + self._contact.unheeded
        lines.append(Check("command mode", not misses, misses or self._modes.reported))
        return [*lines, self._position(told, now), self._autopilot(now)]

    def _heartbeat(self, now: Time) -> Check:
        heard, wanted = self._heard, self._profile.name
        if heard.heartbeat is None:
            return Check("heartbeat", False, "none was heard")
        age = (now - heard.heartbeat) / NS
        if now - heard.heartbeat > ALIVE:
            return Check("heartbeat", False, f"the last one {age:.1f} s ago")
        maker = MAKERS.get(heard.autopilot or 0, f"autopilot {heard.autopilot}")
        if maker != wanted:
            way_out = "set the driver's `autopilot`, or `system`"
            reason = f"it is {maker}, {wanted} is expected: {way_out}"
            return Check("heartbeat", False, reason, waits=False)
        return Check("heartbeat", True, f"{maker} in {self._modes.reported}, {age:.1f} s ago")

    def _position(self, told: tuple[Estimate, Time] | None, now: Time) -> Check:
        own, spread = self._telemetry.odometry, self._telemetry.spread
        if self._is_outside and (told is None or now - told[1] > NS):
            return Check("position", False, "it is told none: kybflow has no estimate to send")
        if spread is None:
            flags = f"it has none (estimator flags {self._heard.ekf})"
            return Check("position", False, f"{flags}; {self._demands.fed()}")
        if own is None:
            return Check("position", False, "it tells none yet")
        if self._is_outside and told is not None:
            apart = distance(own.position, told[0].position)
            reason = f"{apart:.2f} m from where it is told to be ({APART:.2f} m allowed)"
            return Check("position", apart <= APART, reason)
        return Check("position", True, f"spread {spread:.2f} m")

    def _autopilot(self, now: Time) -> Check:
        heard = self._heard
        if heard.armed:
            reason = f"it is armed already, in {self._modes.reported}"
            return Check("autopilot", False, reason, waits=False)
        unready = self._profile.ready(heard)
        if unready is None:
            self._asks = None
            return Check("autopilot", True, "ready to arm")
        self._ask(now)
        words = heard.words(max(now - REPEATED, 0))
        reason = f"{unready}: {words}" if words else unready
        return Check("autopilot", False, f"{reason}; {heard.ill}" if heard.ill else reason)

    def _ask(self, now: Time) -> None:
        """Have it say why it is unready."""
        if self._asks is None:
            self._asks = now + UNREADY
        elif now >= self._asks:
            self._asks = now + AGAIN
            self._requests.ask(RUN_PREARM_CHECKS, now=now)
