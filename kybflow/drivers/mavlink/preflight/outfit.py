"""Whether an autopilot's parameters are those that flight indoors without GPS needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, NamedTuple

from kybflow.drivers.mavlink.firmware.profile import OWN, Profile, Setting

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.telemetry.parameters import Parameters

State = Literal["right", "written", "WRONG", "MISSING", "REFUSED"]


class Row(NamedTuple):
    """One setting as it was found: what the autopilot has, None where it has none; what it needs,
    in words; the reason where it refused what was written."""

    setting: Setting
    found: float | None
    needs: str
    state: State
    reason: str = ""

    @property
    def is_right(self) -> bool:
        return self.state in ("right", "written")


class Outfit:
    """What a kind of autopilot needs. own: our system id. simulator: whether it is the firmware's
    own simulator, which has a few parameters more. names: all that must be read, those that may be
    dangerous too."""

    def __init__(self, profile: Profile, own: int, *, simulator: bool) -> None:
        self.profile, self._own = profile, own
        self.settings = [s for s in profile.indoors if simulator or not s.simulator_only]
        dangers = (danger.name for danger in profile.dangers)
        self.names = tuple(dict.fromkeys((*(s.name for s in self.settings), *dangers)))

    def wrong(self, values: Mapping[str, float]) -> dict[str, float]:
        """What is to be written, by name, of what the autopilot has."""
        return {
            s.name: s.wanted(self._own, values[s.name])
            for s in self.settings
            if s.name in values and not s.accepts(values[s.name], self._own)
        }

    def rows(self, parameters: Parameters, written: Mapping[str, float]) -> list[Row]:
        """A row a setting. written: what was written, by name."""
        return [
            self._row(setting, parameters, setting.name in written) for setting in self.settings
        ]

    def dangers(self, values: Mapping[str, float]) -> list[str]:
        """What is dangerous and none of the settings mends."""
        mended = {setting.name for setting in self.settings}
        rest = {name: value for name, value in values.items() if name not in mended}
        return self.profile.dangerous(rest, self._own, indoors=True)

    def _row(self, setting: Setting, parameters: Parameters, was_written: bool) -> Row:
        found = parameters.values.get(setting.name)
        needs = self._needs(setting)
        reason = parameters.refused.get(setting.name, "")
        if found is None:
            return Row(setting, None, needs, "REFUSED" if reason else "MISSING", reason)
        if setting.accepts(found, self._own):
            return Row(setting, found, needs, "written" if was_written else "right")
        return Row(setting, found, needs, "REFUSED" if was_written else "WRONG", reason)

    def _needs(self, setting: Setting) -> str:
        value = f"{self._own if setting.value == OWN else setting.value:g}"
        if setting.rule == "at_most":
            return f"at most {value}"
        if setting.rule == "bits":
            return f"with bits {value}"
        return " or ".join((value, *(f"{other:g}" for other in setting.allowed)))
