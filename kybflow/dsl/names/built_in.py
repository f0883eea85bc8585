"""The states that every vehicle has, and the transitions that the language adds."""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.parts import AIR, GROUND, Leg

BUILT_IN = {
    "landed": "wait_on_ground",
    "brake": "brake",
    "hover": "hover",
    "auto_home": "go_home",
    "auto_land": "land",
    "land_blind": "land_blind",
    "fault": "wait_on_ground",
}
"""The behavior of each built-in state. `brake` is followed by `hover`, `hover` after `hover_limit`
by `auto_land`, `auto_home` by `auto_land`, `auto_land` by `landed`, and `land_blind` by `fault`,
which only a reset leaves."""


def end_of(legs: Iterable[Leg]) -> str:
    """Return the state that follows a behavior without `then` when it is done."""
    return "brake" if any(leg.end is AIR for leg in legs) else "landed"


def failure_of(legs: Iterable[Leg]) -> str:
    """Return the state that follows a behavior without `failed` when it fails: `landed` if it stays
    on the ground, `brake` if it can begin and end in the air, `auto_land` for a take-off or a
    landing, during which the vehicle may be on the ground."""
    every = tuple(legs)
    if all(leg == (GROUND, GROUND) for leg in every):
        return "landed"
    return "brake" if (AIR, AIR) in every else "auto_land"
