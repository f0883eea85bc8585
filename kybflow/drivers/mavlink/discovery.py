"""Autopilots outside a mission: which are at an address, and the setup of their parameters with
`kybflow mavlink setup`.

An autopilot may be silent until it receives a message, and PX4 sends texts only to ground stations;
therefore a ground station's heartbeat is sent once a second. It has another system id than a run:
an ArduPilot whose `SYSID_MYGCS` is the run's would otherwise take it for the run's heartbeat, and
would not land a vehicle whose run has ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Literal, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.firmware import OWN, FirmwareProfile, Needed
from kybflow.drivers.mavlink.protocol.signing import Signing
from kybflow.drivers.mavlink.telemetry.parameters import AutopilotParameters
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus
from kybflow.drivers.mavlink.transport.router import AUTOPILOT, HEARTBEAT, Port, Router
from kybflow.drivers.mavlink.transport.wire import Wire

FIRST_TIMEOUT_NS: Time = 6 * NS
"""The longest wait for the first message: some autopilots need two of our heartbeats."""
FURTHER_TIMEOUT_NS: Time = 3 * NS // 2
"""How much longer to wait for further autopilots."""
ASKING_SYSTEMS = (246, 247, 248)
"""Our system ids for discovery; the first that is neither the run's nor the one that is looked for
is used."""
HEARTBEAT_TIMEOUT_NS: Time = 5 * NS
"""An autopilot that has sent no heartbeat for this long counts as gone."""


class Discovery:
    """Searches one wire for autopilots.

    statuses: what each autopilot reported, by system id.
    parameters: the parameters of each autopilot, by system id.
    system: the system id to find, None for any.
    own_system, key: as in a mission, whose run may fly at the same time."""

    def __init__(
        self, wire: Wire, system: int | None, own_system: int, key: bytes | None = None
    ) -> None:
        self.statuses: dict[int, ReceivedStatus] = {}
        self.parameters: dict[int, AutopilotParameters] = {}
        self.now: Time = 0
        self._wire, self._system = wire, system
        self._own = next(one for one in ASKING_SYSTEMS if one not in (system, own_system))
        signing = None if key is None else Signing(key)
        self._router = Router({wire.address: wire}, self._own, signing)
        first = system or 1
        self._asked = self._router.port(wire.address, first)
        self._ports: dict[int, Port] = {first: self._asked}
        self._beat: Time | None = None

    def step(self, now: Time) -> None:
        """Handle the messages that arrived, and send our heartbeats."""
        self.now = now
        self._router.poll(now)
        for system in sorted(self._asked.heard_from - set(self._ports) - {self._own}):
            self._ports[system] = self._router.port(self._wire.address, system)
        for system, port in self._ports.items():
            for message in port.take():
                self.statuses.setdefault(system, ReceivedStatus()).handle(message, now)
                if system in self.parameters:
                    self.parameters[system].handle(message, now)
        if self._beat is None or now - self._beat >= NS:
            self._beat = now
            for port in self._ports.values():
                port.send(HEARTBEAT)

    def watch(
        self, ticks: Iterator[Time], timeout: Time, until: Callable[[], bool] = lambda: False
    ) -> None:
        """Step through the ticks until the timeout, or until `until` returns true."""
        end = self.now + timeout
        while self.now < end and not until():
            self.step(next(ticks))

    def find(self, ticks: Iterator[Time]) -> list[int]:
        """Wait for the requested system and return it as soon as it is heard; if any system will
        do, return all that are heard. Raises DriverError if none is."""
        self.watch(ticks, FIRST_TIMEOUT_NS, lambda: bool(self._fitting()))
        if self._system is None and self._fitting():
            self.watch(ticks, FURTHER_TIMEOUT_NS)
        return self.found()

    def found(self) -> list[int]:
        """Return the systems found. Raises DriverError if there are none, naming the systems that
        were heard instead and what to try."""
        if fitting := self._fitting():
            return fitting
        if others := self.there():
            names = ", ".join(str(system) for system in others)
            raise DriverError(
                f"system {self._system} is not heard at {self._wire.address}, but {names}"
            )
        trouble = self._asked.trouble() or f"no autopilot is heard at {self._wire.address}"
        raise DriverError(f"{trouble}; {self._asked.to_ask}")

    def _fitting(self) -> list[int]:
        return [s for s in self.there() if self._system in (None, s)]

    def there(self) -> list[int]:
        """Return the systems whose autopilot sent a heartbeat."""
        return sorted(s for s, statuses in self.statuses.items() if statuses.heartbeat is not None)

    def settle(
        self,
        system: int,
        profile: FirmwareProfile,
        ticks: Iterator[Time],
        names: Iterable[str],
        writes: Mapping[str, float] | None = None,
    ) -> AutopilotParameters:
        """Write parameters of an autopilot that was found, then read all of `names` again. Raises
        DriverError if the autopilot falls silent."""
        if system not in self.parameters:
            self.parameters[system] = AutopilotParameters(
                profile.integer_parameters_bytewise,
                target=(system, AUTOPILOT),
                renamed=profile.renamed,
            )
        parameters, written, read = self.parameters[system], writes or {}, tuple(names)
        for name, value in written.items():
            parameters.write(name, value, self.now)
        self._await(system, parameters, tuple(written), ticks)
        parameters.read(read, self.now, again=True)
        self._await(system, parameters, read, ticks)
        return parameters

    def _await(
        self,
        system: int,
        parameters: AutopilotParameters,
        names: tuple[str, ...],
        ticks: Iterator[Time],
    ) -> None:
        while not parameters.is_complete(names):
            for message in parameters.due(self.now):
                self._ports[system].send(message)
            self.step(next(ticks))
            heartbeat = self.statuses[system].heartbeat
            if heartbeat is None or self.now - heartbeat > HEARTBEAT_TIMEOUT_NS:
                raise DriverError(
                    f"system {system} at {self._wire.address} fell silent: is it still powered and"
                    " in reach?"
                )


RowState = Literal["right", "written", "WRONG", "MISSING", "REFUSED"]


class ParameterRow(NamedTuple):
    """A setting and its value in the autopilot.

    found: the autopilot's value, None if it has no such parameter. needs: a description of the
    required value. reason: why the autopilot refused the written value."""

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
        rows = []
        for setting in self.settings:
            value = f"{self._own if setting.value == OWN else setting.value:g}"
            needs = {
                "equal": " or ".join((value, *(f"{other:g}" for other in setting.allowed))),
                "at_most": f"at most {value}",
                "bits": f"with bits {value}",
            }[setting.rule]
            found, was_written = parameters.values.get(setting.name), setting.name in written
            reason = parameters.refused.get(setting.name, "")
            state: RowState
            if found is None:
                state = "REFUSED" if reason else "MISSING"
            elif setting.accepts(found, self._own):
                state, reason = "written" if was_written else "right", ""
            else:
                state = "REFUSED" if was_written else "WRONG"
            called = setting._replace(name=parameters.called(setting.name))
            rows.append(ParameterRow(called, found, needs, state, reason))
        return rows

    def dangers(self, values: Mapping[str, float]) -> list[str]:
        """Return descriptions of the dangers that no setting removes."""
        cured = {setting.name for setting in self.settings}
        rest = {name: value for name, value in values.items() if name not in cured}
        return list(self.profile.dangers_in(rest, self._own, indoors=True).values())
