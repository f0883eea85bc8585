"""Checks the values that a phase or a callback passes to a state (KYB244). All other checks use
these values in place of the state's own."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.limits import beyond_the_airframe, too_fast, too_steep
from kybflow.dsl.checks.margins import gains_that_oscillate
from kybflow.dsl.checks.obstacles import flies_into, kept_from_goals
from kybflow.dsl.checks.space import held_back, leaves_the_fence, refuses
from kybflow.dsl.checks.together import at_odds
from kybflow.dsl.checks.watching import crossed_at_once
from kybflow.dsl.diagnostics import Collector, Diagnostic
from kybflow.dsl.expanding.flows import entry_values, valued_requests
from kybflow.dsl.names import BUILT_IN

OF_ENTRIES = (
    leaves_the_fence,
    held_back,
    flies_into,
    kept_from_goals,
    too_fast,
    too_steep,
    refuses,
)
"""The checks that apply when a state is entered with values in flight: those that depend only on
the values and the entry position."""


OF_OPTIONS = (*OF_ENTRIES, beyond_the_airframe, gains_that_oscillate, crossed_at_once, at_odds)
"""The checks that apply when an option is changed in flight."""


def values(case: Case) -> Iterator[Diagnostic]:
    """KYB244: a request passes values that the state can't be entered with.

    `run: {a: {goto: {position: [1, 0, 1]}}}` enters `goto` with another position; its other
    parameters and its transitions stay as declared. Each value must have the type and unit of its
    parameter and lie within its bounds. The flight with the values is checked as if they were
    written in the behavior. Built-in states take no values, and parameters that name a file can't
    be passed.
    """
    for who, request in valued_requests(case.plan):
        for name in case.plan.members(who):
            vehicle = case.plan.fleet[name]
            state = vehicle.states.get(vehicle.goal(request.state))
            if state is not None:
                found = Collector()
                entry_values(request.source, state.behavior, found)
                yield from found.all
            elif request.state in BUILT_IN:
                yield Diagnostic(
                    "KYB244",
                    f"`{request.state}` is a built-in state and takes no values",
                    request.source.node.span,
                    help="give the vehicle its own behavior for this",
                )
