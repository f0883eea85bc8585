"""Events that arrows and callbacks wait for: KYB208."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.told import ANY, Told
from kybflow.dsl.diagnostics import Diagnostic, did_you_mean
from kybflow.dsl.document import Transition
from kybflow.dsl.source import Text
from kybflow.observables import TOO_LATE


def unknown_events(case: Case) -> Iterator[Diagnostic]:
    """KYB208: an arrow or a callback waits for an event that nothing here tells, or that no tick
    follows, so that nothing ever comes of it.

    Known are the engine's events, those that the vehicles' parts declare, those that the mission's
    own actions emit, and `operator.NAME`, which a person gives. An arrow hears its own vehicle's
    and the run's as `NAME`; everybody hears `VEHICLE.NAME` and `any.NAME`; a callback also
    `GROUP.NAME`.
    """
    told = Told(case)
    for vehicle, state in case.states():
        yield from _unheard_by(state.transitions, told, vehicle.name.text)
    for flow in case.document.flows.values():
        for phase in flow.phases.values():
            yield from _unheard_by(phase.transitions, told, None)
    for callback in case.document.callbacks:
        event = callback.event
        if told.tellers(event.text):
            yield from _too_late(event, told)
        else:
            yield _unheard(event, told, None, case.document.groups)


def _unheard_by(
    transitions: Iterable[Transition], told: Told, own: str | None
) -> Iterator[Diagnostic]:
    for event in (t.event for t in transitions if t.event is not None):
        if told.hears(event.text, own):
            yield from _too_late(event, told)
        else:
            yield _unheard(event, told, own, ())


def _unheard(event: Text, told: Told, own: str | None, groups: Iterable[str]) -> Diagnostic:
    hint = did_you_mean(event.text, told.names(own, groups))
    if "." not in event.text and any(event.text in events for events in told.of.values()):
        hint = f"it is a vehicle's: write `{ANY}.{event.text}` or `VEHICLE.{event.text}`"
    message = f"nothing here tells the event `{event.text}`"
    return Diagnostic("KYB208", message, event.span, label="never heard", help=hint)


def _too_late(event: Text, told: Told) -> Iterator[Diagnostic]:
    if event.text.rpartition(".")[2] in TOO_LATE and event.text not in told.custom:
        message = f"nothing can follow the event `{event.text}`"
        yield Diagnostic("KYB208", message, event.span, label="the run is over then")
