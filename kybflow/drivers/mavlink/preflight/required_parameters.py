"""The parameters that an autopilot must have before it flies: the preflight checks of them, and
their setup with `kybflow mavlink setup`.

The check `watchdog` fails on values that make the vehicle dangerous if this program or the link
fails. The check `parameters` covers what else flight without GPS needs: it lists each wrong value
on a line, and the command that corrects them all. Each wrong value appears only once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

from kybflow.core.text import detailed
from kybflow.drivers.mavlink.firmware import OWN, FirmwareProfile, Needed
from kybflow.parts import Check

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.autopilot_state import AutopilotState
    from kybflow.drivers.mavlink.params import MavlinkParams
    from kybflow.drivers.mavlink.telemetry.parameters import AutopilotParameters


class RequiredParameters:
    """The preflight checks of one autopilot's parameters. params: the driver's parameters in the
    mission."""

    def __init__(self, autopilot: AutopilotState, params: MavlinkParams) -> None:
        self._profile, self._parameters = autopilot.profile, autopilot.parameters
        self._autopilot = autopilot
        self._is_outside, self._system = autopilot.is_outside, autopilot.port.system
        self._params, self._own = params, params.own_system
        feeds = autopilot.profile.feeds if self._is_outside else autopilot.profile.feeds_own
        self._feeds = feeds

    def names(self) -> list[str]:
        """Return the names of the parameters to read."""
        settings = (setting.name for setting in self._settings())
        dangers = (danger.name for danger in self._profile.dangers)
        return list(dict.fromkeys((*settings, *dangers, *self._feeds)))

    def watchdog(self) -> Check:
        """Check that the vehicle makes itself safe if this program or the link fails."""
        names = [danger.name for danger in self._profile.dangers]
        if not self._parameters.is_complete(names):
            return Check("watchdog", False, "its parameters are being read")
        if dangers := self._dangers():
            summary = f"dangerous: {', '.join(map(self._parameters.called, dangers))}"
            return Check("watchdog", False, detailed(summary, dangers.values()), waits=False)
        if (reaction := self._profile.reaction) not in self._parameters.values:
            reason = f"it does not report {reaction}, what it does once this program is dead"
            reason += self._autopilot.ignored_because or ": does it receive our messages?"
            return Check("watchdog", False, reason, waits=False)
        return Check("watchdog", True, self._reaction() + self._missing(names))

    def set_up(self) -> Check:
        """Check that the autopilot is set up for flight without GPS."""
        settings, values = list(self._settings()), self._parameters.values
        names = [setting.name for setting in settings]
        if not self._parameters.is_complete(names):
            known = sum(name in values for name in names)
            return Check("parameters", False, f"{known} of {len(names)} have been read")
        wrong = [s for s in settings if self._is_wrong(s)]
        if not wrong:
            return Check("parameters", True, "set for flight without GPS" + self._missing(names))
        summary = f"{len(wrong)} of {len(names)} are not as flight without GPS needs them"
        dangers = self._dangers()
        rest = [setting for setting in wrong if setting.name not in dangers]
        if len(rest) < len(wrong):
            summary += f", {len(wrong) - len(rest)} of these under `watchdog`"
        rows = [*self._table(rest), f"to set all of them: `{self._cure()} --write`"]
        return Check("parameters", False, detailed(summary, rows), waits=False)

    def fed(self) -> str:
        """Describe where the autopilot should get its position from, and what to do if it has
        none."""
        values = self._parameters.values
        known = ", ".join(
            f"{self._parameters.called(name)} {values[name]:g}"
            for name in self._feeds
            if name in values
        )
        if not self._is_outside:
            return f"it finds its own by {known}: does it receive satellites?"
        if any(self._is_wrong(setting) for setting in self._settings()):
            return "it is not set up to use the one that kybflow sends: see `parameters`"
        return (
            f"kybflow sends it one, and it is set up to use it ({known}): parameters that were just"
            " written may count only after a restart"
        )

    def _settings(self) -> Iterator[Needed]:
        """Yield the settings that flight without GPS needs; none if the vehicle flies by its own
        GPS."""
        if self._is_outside:
            for setting in self._profile.indoors:
                if self._params.simulator or not setting.simulator_only:
                    yield setting

    def _dangers(self) -> dict[str, str]:
        """Return descriptions of the dangers, by parameter name."""
        values = self._parameters.values
        found = self._profile.dangers_in(values, self._own, indoors=self._is_outside)
        called = self._parameters.called
        return {name: words.replace(name, called(name), 1) for name, words in found.items()}

    def _reaction(self) -> str:
        name, values = self._profile.reaction, self._parameters.values
        setting = next(s for s in self._profile.indoors if s.name == name)
        if not self._is_wrong(setting):
            return setting.does(values[name])
        return f"{name} is {values[name]:g}, which is not dangerous here"

    def _table(self, wrong: Sequence[Needed]) -> Iterator[str]:
        """Yield one line per parameter: its name, the value found, the value needed, and the
        reason."""
        values, own, called = self._parameters.values, self._own, self._parameters.called
        cells = [
            (
                f"{called(s.name)} is {values[s.name]:g},",
                f"should be {s.wanted(own, values[s.name]):g}:",
            )
            for s in wrong
        ]
        found, wanted = (max((len(row[i]) for row in cells), default=0) for i in range(2))
        for row, setting in zip(cells, wrong, strict=True):
            yield f"{row[0]:{found}}  {row[1]:{wanted}}  {setting.why}"

    def _cure(self) -> str:
        """Return the command line that shows and sets the parameters."""
        params = self._params
        words = f"kybflow mavlink setup --vehicle {self._profile.name} --system {self._system}"
        if params.address is not None:
            words += f" --address {params.address}"
        if params.own_system != type(params).own_system:
            words += f" --own-system {params.own_system}"
        if params.key is not None:
            words += f" --key {params.key}"
        return words + (" --simulator" if params.simulator else "")

    def _is_wrong(self, setting: Needed) -> bool:
        """Return whether the value is known and not acceptable."""
        found = self._parameters.values.get(setting.name)
        return found is not None and not setting.accepts(found, self._own)

    def _missing(self, names: list[str]) -> str:
        missing = [name for name in dict.fromkeys(names) if name in self._parameters.missing]
        return f"; it does not know {', '.join(missing)}" if missing else ""


RowState = Literal["right", "written", "WRONG", "MISSING", "REFUSED"]


class ParameterRow(NamedTuple):
    """One setting as it was found.

    found: the autopilot's value, None if it has no such parameter.
    needs: a description of the value needed.
    reason: why the autopilot refused the written value."""

    setting: Needed
    found: float | None
    needs: str
    state: RowState
    reason: str = ""

    @property
    def is_right(self) -> bool:
        return self.state in ("right", "written")


class ParameterSetup:
    """The parameters that a firmware needs. own: our system id. simulator: whether it is the
    firmware's own simulator, which has a few more. names: all parameters to read, including
    dangerous ones."""

    def __init__(self, profile: FirmwareProfile, own: int, *, simulator: bool) -> None:
        self.profile, self._own = profile, own
        self.settings = [s for s in profile.indoors if simulator or not s.simulator_only]
        dangers = (danger.name for danger in profile.dangers)
        self.names = tuple(dict.fromkeys((*(s.name for s in self.settings), *dangers)))

    def wrong(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values to write, by name. values: the autopilot's values."""
        return {
            s.name: s.wanted(self._own, values[s.name])
            for s in self.settings
            if s.name in values and not s.accepts(values[s.name], self._own)
        }

    def rows(
        self, parameters: AutopilotParameters, written: Mapping[str, float]
    ) -> list[ParameterRow]:
        """Return one row per setting. written: the written values, by name."""
        return [
            self._row(setting, parameters, setting.name in written) for setting in self.settings
        ]

    def dangers(self, values: Mapping[str, float]) -> list[str]:
        """Return descriptions of the dangers that no setting removes."""
        cured = {setting.name for setting in self.settings}
        rest = {name: value for name, value in values.items() if name not in cured}
        return list(self.profile.dangers_in(rest, self._own, indoors=True).values())

    def _row(
        self, setting: Needed, parameters: AutopilotParameters, was_written: bool
    ) -> ParameterRow:
        found = parameters.values.get(setting.name)
        needs = self._needs(setting)
        reason = parameters.refused.get(setting.name, "")
        setting = setting._replace(name=parameters.called(setting.name))
        if found is None:
            return ParameterRow(setting, None, needs, "REFUSED" if reason else "MISSING", reason)
        if setting.accepts(found, self._own):
            return ParameterRow(setting, found, needs, "written" if was_written else "right")
        return ParameterRow(setting, found, needs, "REFUSED" if was_written else "WRONG", reason)

    def _needs(self, setting: Needed) -> str:
        value = f"{self._own if setting.value == OWN else setting.value:g}"
        if setting.rule == "at_most":
            return f"at most {value}"
        if setting.rule == "bits":
            return f"with bits {value}"
        return " or ".join((value, *(f"{other:g}" for other in setting.allowed)))
