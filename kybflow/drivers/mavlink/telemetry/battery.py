"""What one autopilot says about its battery, in every form: the charge and the voltage, and that it
runs low.

It says the latter in BATTERY_STATUS (charge_state), in SYS_STATUS (the battery is not well) and in
words (STATUSTEXT). A state counts while it lasts, words of an armed vehicle until it is disarmed:
those of before are the preflight's. An autopilot whose failsafe is set up to do nothing says it all
the same, and from the state `acts_at` on it would act."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from kybflow.core.signals import NS, Battery, BatteryWarning, Time
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus, ReceivedText

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

SILENT: Time = 5 * NS
"""How long BATTERY_STATUS must be silent for SYS_STATUS to count."""
LOW, CRITICAL, EMERGENCY, FAILED, UNHEALTHY = 2, 3, 4, 5, 6
STATES = MappingProxyType(
    {
        LOW: "low", CRITICAL: "critical", EMERGENCY: "nearly empty", FAILED: "failed",
        UNHEALTHY: "not well",
    }
)  # fmt: skip
"""MAV_BATTERY_CHARGE_STATE, but for those that are no reason to worry."""
WORDS = MappingProxyType(
    {"emergency": EMERGENCY, "dangerous": EMERGENCY, "critical": CRITICAL, "low": LOW}
)
"""What of a text about a battery says which state, the worst first."""
MONITOR = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY


class BatteryReports:
    """The reports of one autopilot about its batteries. acts_at: the state from which on its own
    failsafe acts where it is set up to."""

    def __init__(self, status: ReceivedStatus, acts_at: int) -> None:
        self._status, self._acts_at = status, acts_at
        self._newest: Battery | None = None
        self._states: dict[int, int] = {}
        self._text: ReceivedText | None = None
        self._said: tuple[int, str] = (0, "")

    def hear(self, message: Message, now: Time) -> Battery | None:
        """The battery after this message, None where it told nothing new or is not known."""
        is_general = message.get_type() == "SYS_STATUS"
        if not is_general:
            self._states[message.id] = message.charge_state
        told = self._status.at.get("BATTERY_STATUS")
        is_better_known = is_general and told is not None and now - told < SILENT
        before = self._newest
        newest = (None if is_better_known else codec.battery(message, now)) or before
        if newest is None:
            return None
        self._newest = newest = newest._replace(warning=self._warning())
        return None if newest == before else newest

    def _warning(self) -> BatteryWarning | None:
        """What it says of a battery that runs low, None while it says nothing."""
        self._read_texts()
        level, text = self._said
        said = [f"it says '{text}'"] if text else []
        states = self._states.values()
        worst = max((state for state in states if LOW <= state <= FAILED), default=0)
        sensors = self._status.sensors
        if not worst and (UNHEALTHY in states or (sensors and sensors.ill & MONITOR)):
            worst = UNHEALTHY
        if worst:
            said.append(f"it reports its battery as {STATES[worst]}")
        if not said:
            return None
        acts = level >= self._acts_at or self._acts_at <= worst <= FAILED
        return BatteryWarning("; ".join(said), acts)

    def _read_texts(self) -> None:
        """Take note of the newest words about the battery of an armed vehicle."""
        if not self._status.armed:
            self._said = (0, "")
        for text in self._status.texts_after(self._text):
            self._text = text
            level = self._level(text.text.lower()) if self._status.armed else 0
            if level >= max(self._said[0], LOW):
                self._said = (level, text.text)

    def _level(self, words: str) -> int:
        """The state of the battery that a text tells, 0 where it tells none."""
        if "battery" not in words:
            return 0
        if "failsafe" in words and "clear" not in words:
            return self._acts_at
        return next((state for word, state in WORDS.items() if word in words), 0)
