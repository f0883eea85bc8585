"""The flows of the document to those of the plan: groups become their vehicles."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import Document, FlowEntry, PhaseEntry, TransitionEntry
from kybflow.dsl.expressions import Scope, parse
from kybflow.dsl.names.option_names import members, option_values
from kybflow.dsl.plan import Arrive, FlowPlan, PhasePlan, SetOption, TransitionPlan, Values
from kybflow.dsl.shaping.entry_values import values_for
from kybflow.dsl.shaping.flows import given_vehicles, own_vehicles

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


def flow_plans(document: Document, scope: Scope, catalog: Catalog) -> tuple[FlowPlan, ...]:
    """Every flow, in the order of the mission; `scope` is that of a phase's conditions."""
    return tuple(_flow(flow, document, scope, catalog) for flow in document.flows.values())


def _flow(flow: FlowEntry, document: Document, scope: Scope, catalog: Catalog) -> FlowPlan:
    own = own_vehicles(document, flow)
    return FlowPlan(
        name=flow.name.text,
        begin=flow.begin.text,
        vehicles=own,
        phases={n: _phase(p, document, scope, catalog) for n, p in flow.phases.items()},
        waits=not own and bool(given_vehicles(document, flow)),
        at=flow.span.at,
    )


def _phase(phase: PhaseEntry, document: Document, scope: Scope, catalog: Catalog) -> PhasePlan:
    options = (
        SetOption(option.name, value)
        for action in phase.set
        for option, value in option_values(action, document, catalog, Findings())
    )
    named = _spread(phase.run, document)
    run = {name: document.vehicles[name].goal(state) for name, state in named.items()}
    return PhasePlan(
        name=phase.name.text,
        run=run,
        give=_spread(phase.give, document),
        set=tuple(options),
        transitions=tuple(_transition(transition, scope) for transition in phase.transitions),
        chains={name: state for name, state in named.items() if state != run[name]},
        at=phase.span.at,
        values=_values(phase, document),
        ends=all(bool(transition.since) for transition in phase.transitions),
        arrive=None if phase.arrive is None else cast("Arrive", phase.arrive.text),
    )


def _values(phase: PhaseEntry, document: Document) -> dict[str, Values]:
    """The values that vehicles are asked to enter their states with."""
    return {
        name: values_for(document.vehicles[name], state.text, phase.values[who.text])
        for who, state in phase.run
        if who.text in phase.values
        for name in members(document, who.text)
    }


def _spread(pairs: tuple[tuple[Text, Text], ...], document: Document) -> dict[str, str]:
    return {vehicle: goal.text for who, goal in pairs for vehicle in members(document, who.text)}


def _transition(transition: TransitionEntry, scope: Scope) -> TransitionPlan:
    return TransitionPlan(
        cause=transition.cause,
        target=transition.target.text,
        when=None if transition.when is None else parse(transition.when, scope)[0],
        event=None if transition.event is None else transition.event.text,
        after=transition.after,
        hold=transition.hold,
        at=transition.span.at,
        emit=None if transition.emit is None else transition.emit.text,
    )
