"""The states that every vehicle has, and the transitions that the language adds."""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.parts import AIR, GROUND, Leg

LANDED, FAULT = "landed", "fault"
BRAKE, HOVER = "brake", "hover"
AUTO_HOME, AUTO_LAND, LAND_BLIND = "auto_home", "auto_land", "land_blind"

BUILT_IN = {
    LANDED: "wait_on_ground",
    BRAKE: "brake",
    HOVER: "hover",
    AUTO_HOME: "go_home",
    AUTO_LAND: "land",
    LAND_BLIND: "land_blind",
    FAULT: "wait_on_ground",
}
"""The behavior of each built-in state. `brake` is followed by `hover`, `hover` after `hover_limit`
by `auto_land`, `auto_home` by `auto_land`, `auto_land` by `landed`, and `land_blind` by `fault`,
which only a reset leaves."""


def end_of(legs: Iterable[Leg]) -> str:
    """Return the state that follows a behavior without `then` when it is done."""
    return BRAKE if any(leg.end is AIR for leg in legs) else LANDED


def failure_of(legs: Iterable[Leg]) -> str:
    """Return the state that follows a behavior without `failed` when it fails: `landed` if it stays
    on the ground, `brake` if it can begin and end in the air, `auto_land` for a take-off or a
    landing, during which the vehicle may be on the ground."""
    every = tuple(legs)
    if all(leg == (GROUND, GROUND) for leg in every):
        return LANDED
    return BRAKE if (AIR, AIR) in every else AUTO_LAND
