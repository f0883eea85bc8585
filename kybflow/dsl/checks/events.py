"""Events that an arrow waits for: KYB208."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic, Severity, did_you_mean
from kybflow.dsl.document import Vehicle
from kybflow.observables import EVENTS, OF_THE_RUN


def unknown_events(case: Case) -> Iterator[Diagnostic]:
    """KYB208: an arrow waits for an event that nothing here tells, so that it may never fire.

    Known are the engine's events and those that the vehicle's parts declare: `NAME` is the own
    vehicle's or the run's, `VEHICLE.NAME` that of another one.
    """
    told = {name: _told_by(vehicle) for name, vehicle in case.document.vehicles.items()}
    for vehicle, state in case.states():
        own = told[vehicle.name.text] | OF_THE_RUN
        for transition in state.transitions:
            event = transition.event
            if event is None:
                continue
            name, dot, _ = event.text.partition(".")
            known = own if not dot else {f"{name}.{other}" for other in told.get(name, ())}
            if event.text in known:
                continue
            hint = f"`{name}` is no vehicle here; {did_you_mean(name, told)}"
            yield Diagnostic(
                "KYB208",
                f"nothing here tells the event `{event.text}`",
                event.span,
                label="may never be heard",
                help=did_you_mean(event.text, known) if known else hint,
                severity=Severity.WARNING,
            )


def _told_by(vehicle: Vehicle) -> set[str]:
    """The events that belong to the vehicle, by their bare names."""
    parts = [*vehicle.processors, *vehicle.supervisors, vehicle.tracker, vehicle.driver]
    parts += [estimator.part for estimator in vehicle.estimators]
    parts += [state.part for state in vehicle.states.values()]
    declared = {event for part in parts for event in part.spec.cls.events}
    return (EVENTS.keys() - OF_THE_RUN) | declared
