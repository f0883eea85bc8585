"""Flies a plan once on ideal vehicles, as fast as possible, and collects the findings."""

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
from kybflow.runtime.scores import Score

NOTHING: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """The result of a rehearsal.

    diagnostics: the findings, sorted. duration: the mission's duration, s. separation: None for a
    single vehicle. charge: None if no vehicle has a battery. assumed: the events that the rehearsal
    gave in place of a person.
    """

    mission: str
    target: str
    diagnostics: tuple[Diagnostic, ...]
    duration: float
    separation: LeastSeparation | None
    charge: LeastCharge | None
    assumed: tuple[Assumed, ...]

    @property
    def is_clean(self) -> bool:
        return not has_errors(self.diagnostics)


def rehearse(
    plan: Plan,
    emitted: Sequence[tuple[float, str]] = (),
    options: Sequence[tuple[str, str]] = (),
    texts: Mapping[str, str] = NOTHING,
) -> Rehearsal:
    """Rehearse `plan`.

    emitted: a person's events as (seconds, name); the rehearsal then doesn't give these events
    itself. options: parameters of parts to change before take-off, as (name, value). texts: the
    mission's files, for the spans of findings. Raises EventRefused for an event that nothing waits
    for, OptionRefused for an option that can't be changed.
    """
    check_emitted(plan, (name for _, name in emitted))
    watch, commands = Watch(plan, texts), CommandQueue(emitted)
    person = Person(plan, commands, (name for _, name in emitted))
    duration, verdicts = 0.0, tuple[Verdict, ...]()
    try:
        duration, verdicts = _flown(plan, watch, person, commands, options)
        found = watch.diagnostics
        if not (found or person.assumed or at_rest(plan)):
            found = tuple(
                findings.unmet(
                    v.text, v.at, "" if v.value is None else format_measured(v.value, v.unit), texts
                )
                for v in verdicts
                if not v.held
            )
    except PartFailed as failure:
        found = (_not_made(plan, failure, texts),)
    return Rehearsal(
        plan.mission, plan.target, in_order(found), duration, watch.separation, watch.charge,
        tuple(person.assumed),
    )  # fmt: skip


def _flown(
    plan: Plan,
    watch: Watch,
    person: Person,
    commands: CommandQueue,
    options: Sequence[tuple[str, str]],
) -> tuple[float, tuple[Verdict, ...]]:
    """Fly the ideal plan to its end; return the duration in seconds and the verdicts of its
    expectations. Raises RuntimeError if the watch or the person failed, because findings may then
    be missing."""
    failures: list[object] = []

    def note_failure(event: Event) -> None:
        if event.name == "observer_failed":
            failures.append(event.fields["reason"])

    flown = ideal(plan)
    events = Events((watch.on_event, note_failure))
    clock, score = SimulatedClock(flown.control_rate), Score(flown)
    devices = open_devices(flown, 0, at_rest(plan))
    try:
        engine = assemble(
            flown, devices, events, clock, score, observers=(watch.on_tick, person),
            commands=commands, judge=PlanEntryJudge(plan), options=options,
        )  # fmt: skip
        watch.begin(engine)
        unfinished = engine.run()
        watch.end(engine)
        if failures:
            raise RuntimeError(f"the rehearsal could not be watched: {failures[-1]}")
    finally:
        devices.close()
    seconds = engine.seconds()
    return seconds, engine.judge.verdicts(None if unfinished else seconds)


def _not_made(plan: Plan, failure: PartFailed, texts: Mapping[str, str]) -> Diagnostic:
    made = ((vehicle.name, part) for vehicle in plan.vehicles for part in vehicle.parts)
    found = ((name, part.at) for name, part in made if part.label == failure.part)
    name, at = next(found, (plan.vehicles[0].name, plan.vehicles[0].at))
    return findings.stays_down(name, failure.part, str(failure), at, texts)
