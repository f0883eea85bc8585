"""Events that arrows and callbacks wait for: KYB208 and KYB209."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.told import ANY, OPERATOR, Told
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean
from kybflow.dsl.document import Transition
from kybflow.dsl.reading.source import Text
from kybflow.parts.observables import OF_THE_SIMULATOR, TOO_LATE


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
    hint, notes = did_you_mean(event.text, told.names(own, groups)), list[str]()
    if "." not in event.text and any(event.text in events for events in told.of.values()):
        hint = f"it is a vehicle's: write `{ANY}.{event.text}` or `VEHICLE.{event.text}`"
    elif not hint.startswith("did"):
        notes = [_of_a_person(event.text.rpartition(".")[2])]
    message = f"nothing here tells the event `{event.text}`"
    return Diagnostic("KYB208", message, event.span, "never heard", tuple(notes), hint)


def _of_a_person(name: str) -> str:
    """How an event is given that no part tells."""
    given = f"{OPERATOR}{name}"
    return f"a person gives `{given}`: `run --emit {given}@2s`; a callback gives `{{emit: {name}}}`"


def _too_late(event: Text, told: Told) -> Iterator[Diagnostic]:
    if event.text.rpartition(".")[2] in TOO_LATE and event.text not in told.custom:
        message = f"nothing can follow the event `{event.text}`"
        yield Diagnostic("KYB208", message, event.span, label="the run is over then")


def of_the_simulator(case: Case) -> Iterator[Diagnostic]:
    """KYB209: a mission acts on something that only the simulator knows.

    That a fault is at work no vehicle can know, and on hardware nobody tells. A mission answers
    what the vehicle notices instead: `estimate_lost`, `battery_low`, `jumped`. A callback may `log`
    it.
    """
    states = [state.transitions for _, state in case.states()]
    phases = [p.transitions for f in case.document.flows.values() for p in f.phases.values()]
    arrows = (arrow for transitions in (*states, *phases) for arrow in transitions)
    acting = [arrow.event for arrow in arrows if arrow.event is not None]
    acting += [
        callback.event
        for callback in case.document.callbacks
        if any(action.name.text != "log" for action in callback.actions)
    ]
    for event in acting:
        if event.text.rpartition(".")[2] in OF_THE_SIMULATOR:
            message = f"only the simulator knows of `{event.text}`"
            hint = "answer what the vehicle notices, like `estimate_lost`; a callback may `log` it"
            yield Diagnostic("KYB209", message, event.span, help=hint)
