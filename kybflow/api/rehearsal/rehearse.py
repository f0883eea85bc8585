"""Flies a plan once on ideal vehicles, as fast as it goes, and says what goes wrong in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from kybflow.api.entry_judge import PlanEntryJudge
from kybflow.api.opening import assemble, open_devices
from kybflow.api.rehearsal import findings
from kybflow.api.rehearsal.ideal import at_rest, ideal
from kybflow.api.rehearsal.person import Assumed, Person
from kybflow.api.rehearsal.watch import LeastCharge, LeastSeparation, Watch
from kybflow.core.errors import PartFailed
from kybflow.core.signals import Event
from kybflow.core.units import format_measured
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, has_errors, in_order
from kybflow.dsl.plan import Plan
from kybflow.runtime.clock import SimulatedClock
from kybflow.runtime.commanding.awaited import check_emitted
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.events import Events
from kybflow.runtime.expectations import Verdict
from kybflow.runtime.making import parts_of
from kybflow.runtime.scores import Score

NOTHING: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What came of a rehearsal: the findings in order; how long the mission took, seconds; the
    least distance of two vehicles and the least charge, None where there was none; and a person's
    events that were assumed."""

    mission: str
    target: str
    diagnostics: tuple[Diagnostic, ...]
    duration: float
    separation: LeastSeparation | None
    charge: LeastCharge | None
    assumed: tuple[Assumed, ...]

    @property
    def is_clean(self) -> bool:
        """Whether no finding is an error."""
        return not has_errors(self.diagnostics)


def rehearse(
    plan: Plan,
    emitted: Sequence[tuple[float, str]] = (),
    options: Sequence[tuple[str, str]] = (),
    texts: Mapping[str, str] = NOTHING,
) -> Rehearsal:
    """Rehearse `plan`. emitted: a person's events, as (seconds, name), in place of those that would
    be assumed. options: changes of parts' parameters before take-off. texts: the mission's files,
    for the spans of findings. Raises EventRefused and OptionRefused for those that can't be."""
    check_emitted(plan, (name for _, name in emitted))
    watch, commands = Watch(plan, texts), CommandQueue(emitted)
    person = Person(plan, commands, (name for _, name in emitted))
    duration, verdicts = 0.0, tuple[Verdict, ...]()
    try:
        duration, verdicts = _flown(plan, watch, person, commands, options)
        found = watch.diagnostics
        if not (found or person.assumed or at_rest(plan)):
            found = tuple(
                findings.unmet(v.text, v.at, _measured(v), texts) for v in verdicts if not v.held
            )
    except PartFailed as failure:
        found = (_not_made(plan, failure, texts),)
    return Rehearsal(
        plan.mission, plan.target, in_order(found), duration, watch.separation, watch.charge,
        tuple(person.assumed),
    )  # fmt: skip


def _measured(verdict: Verdict) -> str:
    value = verdict.value
    return "" if value is None else format_measured(value, verdict.unit)


def _flown(
    plan: Plan,
    watch: Watch,
    person: Person,
    commands: CommandQueue,
    options: Sequence[tuple[str, str]],
) -> tuple[float, tuple[Verdict, ...]]:
    """Fly the ideal plan to its end; return how long it took, seconds, and what became of its
    expectations."""
    flown, blind = ideal(plan), _Blind()
    events = Events((watch.hear, blind.hear))
    clock, score = SimulatedClock(flown.control_rate), Score(flown)
    devices = open_devices(flown, 0, at_rest(plan))
    try:
        engine = assemble(
            flown, devices, events, clock, score, observers=(watch.look, person),
            commands=commands, judge=PlanEntryJudge(plan), options=options,
        )  # fmt: skip
        watch.begin(engine)
        unfinished = engine.run()
        watch.end(engine)
        blind.judge()
    finally:
        devices.close()
    seconds = engine.seconds()
    return seconds, engine.judge.verdicts(None if unfinished else seconds)


class _Blind:
    """Hears when something that looks on was left out because it raised: no finding is trusted
    then."""

    def __init__(self) -> None:
        self._reason = ""

    def hear(self, event: Event) -> None:
        if event.name == "observer_failed":
            self._reason = str(event.fields["reason"])

    def judge(self) -> None:
        """Raises RuntimeError when something was left out, which is a mistake of this program."""
        if self._reason:
            raise RuntimeError(f"the rehearsal could not be watched: {self._reason}")


def _not_made(plan: Plan, failure: PartFailed, texts: Mapping[str, str]) -> Diagnostic:
    made = ((vehicle.name, part) for vehicle in plan.vehicles for part in parts_of(vehicle))
    found = ((name, part.at) for name, part in made if part.label == failure.part)
    name, at = next(found, (plan.vehicles[0].name, plan.vehicles[0].at))
    return findings.stays_down(name, failure.part, str(failure), at, texts)
