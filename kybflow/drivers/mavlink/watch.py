"""What the preflight asks of an autopilot, in its own words where it has any.

What it says of its readiness is about the mode that it is in, so a disarmed vehicle is put into the
mode in which it follows first. One that stays unready is asked to look at itself, for not every one
says what is wrong unasked. Parameters with which it would be dangerous once this program or the
link dies are its `watchdog`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from kybflow.drivers.mavlink.modes import Modes
from kybflow.drivers.mavlink.profile import Setting
from kybflow.geometry import distance
from kybflow.parts import Check
from kybflow.signals import NS, Estimate, Time

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
        self._parameters, self._telemetry = contact.parameters, contact.telemetry
        self._requests, self._system = contact.requests, contact.port.system
        self._is_outside, self._own, self._params = contact.is_outside, params.own_system, params
        self._asks: Time | None = None

    def names(self) -> list[str]:
        """The parameters that are looked at."""
        settings = (setting.name for setting in self.settings())
        dangers = (danger.name for danger in self._profile.dangers)
        return list(dict.fromkeys((*settings, *dangers)))

    def settings(self) -> Iterator[Setting]:
        """What must be set for flight without GPS, where it flies without."""
        if self._is_outside:
            for setting in self._profile.indoors:
                if self._params.simulator or not setting.simulator_only:
                    yield setting

    def checks(self, misses: str, told: tuple[Estimate, Time] | None, now: Time) -> list[Check]:
        """misses: why it is not in the mode in which it follows, empty where it is. told: where it
        was told to be, and when, last."""
        heartbeat = self._heartbeat(now)
        if not heartbeat.green:
            return [heartbeat]
        lines = [heartbeat, self._watchdog()]
        if self._is_outside:
            lines.append(self._set())
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
            return Check("heartbeat", False, f"it is {maker}, {wanted} is expected", waits=False)
        return Check("heartbeat", True, f"{maker} in {self._modes.reported}, {age:.1f} s ago")

    def _watchdog(self) -> Check:
        names = [danger.name for danger in self._profile.dangers]
        if not self._parameters.is_complete(names):
            return Check("watchdog", False, "its parameters are being read")
        dangers = self._profile.dangerous(
            self._parameters.values, self._own, indoors=self._is_outside
        )
        if dangers:
            return Check("watchdog", False, "; ".join(dangers), waits=False)
        reason = "it lands by itself when commands stop"
        return Check("watchdog", True, reason + self._missing(names))

    def _set(self) -> Check:
        settings, values = list(self.settings()), self._parameters.values
        names = [setting.name for setting in settings]
        if not self._parameters.is_complete(names):
            known = sum(name in values for name in names)
            return Check("parameters", False, f"{known} of {len(names)} have been read")
        wrong = [s for s in settings if s.name in values and not self._accepts(s)]
        if not wrong:
            return Check("parameters", True, "set for flight without GPS" + self._missing(names))
        said = "; ".join(
            f"{s.name} is {values[s.name]:g}, {s.wanted(self._own, values[s.name]):g}"
            f" needed: {s.why}"
            for s in wrong
        )
        return Check("parameters", False, f"{said}; `{self._cure()} --write`", waits=False)

    def _cure(self) -> str:
        """The command that looks at its parameters."""
        params = self._params
        words = f"kybflow mavlink setup --vehicle {self._profile.name} --system {self._system}"
        if params.address is not None:
            words += f" --address {params.address}"
        if params.own_system != type(params).own_system:
            words += f" --own-system {params.own_system}"
        if params.key is not None:
            words += f" --key {params.key}"
        return words + (" --simulator" if params.simulator else "")

    def _accepts(self, setting: Setting) -> bool:
        return setting.accepts(self._parameters.values[setting.name], self._own)

    def _missing(self, names: list[str]) -> str:
        missing = [name for name in dict.fromkeys(names) if name in self._parameters.missing]
        return f"; it does not know {', '.join(missing)}" if missing else ""

    def _position(self, told: tuple[Estimate, Time] | None, now: Time) -> Check:
        own, spread = self._telemetry.odometry, self._telemetry.spread
        if self._is_outside and (told is None or now - told[1] > NS):
            return Check("position", False, "it is told none: kybflow has no estimate to send")
        if spread is None:
            return Check("position", False, f"it has none (estimator flags {self._heard.ekf})")
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
        return Check("autopilot", False, f"{unready}: {words}" if words else unready)

    def _ask(self, now: Time) -> None:
        """Have it say why it is unready."""
        if self._asks is None:
            self._asks = now + UNREADY
        elif now >= self._asks:
            self._asks = now + AGAIN
            self._requests.ask(RUN_PREARM_CHECKS, now=now)
