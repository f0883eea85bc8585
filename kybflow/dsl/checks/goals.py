"""What an arrow, an action or a phase may ask a vehicle for: one of its own states or chains, or a
built-in state but `fault`."""

from __future__ import annotations

from kybflow.dsl.checks.case import NO_TARGET, TARGETS
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean, goals_like
from kybflow.dsl.document import Vehicle
from kybflow.dsl.reading.source import Text


def wrong_goal(code: str, name: Text, vehicle: Vehicle) -> Diagnostic | None:
    """The finding for a goal that the vehicle does not have; None for one that it has."""
    if vehicle.goal(name.text) in vehicle.states or name.text in TARGETS:
        return None
    if name.text not in NO_TARGET:
        return no_state(code, name, vehicle, TARGETS)
    return Diagnostic(
        code,
        f"`{name.text}` can't be chosen",
        name.span,
        label="entered by the failsafe alone",
        help="use `auto_land` or `land_blind` to come down",
    )


def no_state(code: str, name: Text, vehicle: Vehicle, more: tuple[str, ...] = ()) -> Diagnostic:
    """The finding for a name that is no state or chain of the vehicle, nor one of `more`."""
    key = "inner goals" if "." in name.text else "goals"
    if key not in vehicle.known:
        vehicle.known[key] = sorted(goals_like(name.text, vehicle.states))
    return Diagnostic(
        code,
        f"`{vehicle.name.text}` has no behavior `{name.text}`",
        name.span,
        label="unknown",
        help=did_you_mean(name.text, (*vehicle.known[key], *more)),
    )
