"""The values that a state is entered with, in a phase and in a callback: KYB244. What a state does
with them is judged by every other check."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.limits import too_steep
from kybflow.dsl.checks.obstacles import flies_into, kept_from_goals
from kybflow.dsl.checks.space import held_back, leaves_the_fence, refuses, too_fast
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Findings
from kybflow.dsl.expanding.entry_values import entry_values, valued_requests
from kybflow.dsl.names.built_in import BUILT_IN

OF_ENTRIES = (
    leaves_the_fence,
    held_back,
    flies_into,
    kept_from_goals,
    too_fast,
    too_steep,
    refuses,
)
"""What a state is judged by when it is entered in flight with values: all that depends on them and
on where it is entered alone."""


def values(case: Case) -> Iterator[Diagnostic]:
    """KYB244: a state is asked for with values that it can't be entered with.

    `run: {a: {goto: {position: [1, 0, 1]}}}` enters `goto` with another position; all else is as
    its behavior says, and so are its transitions. Each value has the type, the unit and the bounds
    of its parameter, and where the behavior goes with it is judged as if it were written there.
    A built-in state takes no values, and a file is read before the flight.
    """
    for who, request in valued_requests(case.plan):
        for name in case.plan.members(who):
            vehicle = case.plan.fleet[name]
            state = vehicle.states.get(vehicle.goal(request.state))
            if state is not None:
                found = Findings()
                entry_values(request.source, state.behavior, found)
                yield from found.all
            elif request.state in BUILT_IN:
                yield Diagnostic(
                    "KYB244",
                    f"`{request.state}` is built in and takes no values",
                    request.source.node.span,
                    help="give the vehicle a behavior of its own for it",
                )
