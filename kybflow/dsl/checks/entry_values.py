"""The values that a state is entered with, in a phase and in a callback: KYB244. What a state does
with them is judged by every other check."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.limits import too_steep
from kybflow.dsl.checks.obstacles import flies_into, kept_from_goals
from kybflow.dsl.checks.space import held_back, leaves_the_fence, refuses, too_fast
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, collect
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.names.option_names import members
from kybflow.dsl.shaping.entry_values import entry_values, valued_requests

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
    for asked in valued_requests(case.document):
        for name in members(case.document, asked.who.text):
            vehicle = case.document.vehicles[name]
            state = vehicle.states.get(vehicle.goal(asked.state.text))
            if state is not None:
                yield from collect(entry_values(asked.values, state.part)).diagnostics
            elif asked.state.text in BUILT_IN:
                yield Diagnostic(
                    "KYB244",
                    f"`{asked.state.text}` is built in and takes no values",
                    asked.values.span,
                    help="give the vehicle a behavior of its own for it",
                )
