"""The preflight checks of an autopilot and of its parameters, with the autopilot's texts.

An autopilot reports its readiness only for its current mode, so a disarmed vehicle is first put
into the mode in which it follows setpoints. If it stays unready, it is requested to run its own
checks, because not every autopilot reports unasked what is wrong. Unhealthy sensors are named along
with its texts.

If its position comes from kybflow, the check `innovations` shows how well the poses fit what its
filter expects from its IMU.

`RequiredParameters` has two checks. `watchdog` fails on values that make the vehicle dangerous if
this program or the link fails. `parameters` covers what else flight without GPS needs: it lists
each wrong value on a line, and the command that corrects them all. Each wrong value appears only
once.

The link makes the checks once a tick before take-off. In flight it still watches the parameters
that `PreflightChecks.names` lists."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Estimate, Time
from kybflow.core.text import detailed
from kybflow.drivers.mavlink.autopilot_state import AutopilotState
from kybflow.drivers.mavlink.control.requests import Modes
from kybflow.drivers.mavlink.firmware import Needed, firmware_by
from kybflow.drivers.mavlink.params import MavlinkParams
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.parts import Check

HEARTBEAT_TIMEOUT_NS: Time = 3 * NS
TEXT_VALIDITY_NS: Time = 35 * NS
"""How long a text about arming counts; autopilots repeat it every 30 s."""
UNREADY_TIME_NS: Time = 3 * NS
"""How long an autopilot may be unready before its own checks are requested."""
OWN_CHECKS_PERIOD_NS: Time = 10 * NS
"""The pause between two such requests."""
TOLERANCE = 0.5
"""The largest allowed distance between the autopilot's position and ours, metres."""


class PreflightChecks:
    """The preflight checks of one autopilot. params: the driver's parameters in the mission."""

    def __init__(self, autopilot: AutopilotState, modes: Modes, params: MavlinkParams) -> None:
        self._profile, self._status, self._modes = autopilot.profile, autopilot.status, modes
        self._autopilot = autopilot
        self._telemetry, self._requests = autopilot.telemetry, autopilot.requests
        self._is_outside = autopilot.is_outside
        self._required = RequiredParameters(autopilot, params)
        self._checks_at: Time | None = None

    def names(self) -> list[str]:
        """Return the names of the parameters to read."""
        return self._required.names()

    def checks(
        self, mode_trouble: str, sent: tuple[Estimate, Time] | None, now: Time
    ) -> list[Check]:
        """Return the current checks. mode_trouble: why the mode that follows setpoints is not in
        force, empty if it is. sent: the last estimate sent to the autopilot, and the time of
        sending."""
        heartbeat = self._heartbeat(now)
        if not heartbeat.green:
            unknown = "unknown: its parameters are read after its heartbeat"
            return [heartbeat, Check("watchdog", False, unknown)]
        lines = [heartbeat, self._required.watchdog()]
        if self._is_outside:
            lines.append(self._required.set_up())
        trouble = mode_trouble and mode_trouble + self._autopilot.ignored_because
        lines.append(Check("command mode", not trouble, trouble or self._modes.reported))
        lines.append(self._position(sent, now))
        if self._is_outside:
            lines.append(self._innovations())
        return [*lines, self._readiness(now)]

    def request_own_checks(self, now: Time) -> None:
        """Request that an autopilot which stays unready runs its own checks, because their texts
        say what is wrong. Called once a tick before take-off."""
        status = self._status
        if status.armed or not self._heartbeat(now).green:
            return
        if self._profile.ready(status) is None:
            self._checks_at = None
        elif self._checks_at is None:
            self._checks_at = now + UNREADY_TIME_NS
        elif now >= self._checks_at:
            self._checks_at = now + OWN_CHECKS_PERIOD_NS
            self._requests.ask(mavlink.MAV_CMD_RUN_PREARM_CHECKS, now=now)

    def _heartbeat(self, now: Time) -> Check:
        status, wanted = self._status, self._profile.name
        if status.heartbeat is None:
            return Check("heartbeat", False, "none was received")
        age = (now - status.heartbeat) / NS
        if now - status.heartbeat > HEARTBEAT_TIMEOUT_NS:
            return Check("heartbeat", False, f"the last one arrived {age:.1f} s ago")
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
            return Check("position", False, "it has not reported one yet")
        if self._is_outside and sent is not None:
            apart = distance(own.position, sent[0].position)
            reason = f"{apart:.2f} m from the one that kybflow sends ({TOLERANCE:.2f} m allowed)"
            return Check("position", apart <= TOLERANCE, reason)
        return Check("position", True, f"spread {spread:.2f} m")

    def _innovations(self) -> Check:
        found = self._status.innovations
        if found is None:
            return Check("innovations", False, "it has not reported its estimator")
        reason = f"{found} of the largest that its filter accepts"
        if max(found) <= 1.0:
            return Check("innovations", True, reason)
        way_out = "check the stream's `units` and `axes`, and its `latency`"
        return Check("innovations", False, f"it rejects the poses, {reason}: {way_out}")

    def _readiness(self, now: Time) -> Check:
        status = self._status
        if status.armed:
            reason = f"it is armed already, in {self._modes.reported}"
            return Check("autopilot", False, reason, waits=False)
        unready = self._profile.ready(status)
        if unready is None:
            return Check("autopilot", True, "ready to arm")
        words = status.words(max(now - TEXT_VALIDITY_NS, 0))
        reason = f"{unready}: {words}" if words else unready
        return Check(
            "autopilot", False, f"{reason}; {status.unhealthy}" if status.unhealthy else reason
        )


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
            reason = f"it does not report {reaction}, its reaction when this program stops"
            reason += self._autopilot.ignored_because or ": does it receive kybflow's messages?"
            return Check("watchdog", False, reason, waits=False)
        found = self._parameters.values[reaction]
        setting = next(s for s in self._profile.indoors if s.name == reaction)
        effect = (
            f"{reaction} is {found:g}, which is not dangerous here"
            if self._is_wrong(setting)
            else setting.does(found)
        )
        return Check("watchdog", True, effect + self._missing(names))

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
        summary = f"{len(wrong)} of {len(names)} are wrong for flight without GPS"
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
            return f"it finds its own heading by {known}: does it receive satellites?"
        if any(self._is_wrong(setting) for setting in self._settings()):
            return "it is not set up to use kybflow's heading: see `parameters`"
        return (
            f"kybflow sends it one, and it is set up to use it ({known}): new parameters may "
            "take effect only after a restart"
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
