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
"""Each built-in state with its behavior. `brake` goes to `hover`, that after `hover_limit` to
`auto_land`, as does `auto_home`, and that to `landed`; `land_blind` goes to `fault`, which only a
reset leaves."""


def end_of(legs: Iterable[Leg]) -> str:
    """Where a behavior without `then` goes when it is done."""
    return "brake" if any(leg.end is AIR for leg in legs) else "landed"


def failure_of(legs: Iterable[Leg]) -> str:
    """Where a behavior without `failed` goes when it fails: a take-off or a landing, which may have
    its feet on the ground, lands; what flies brakes."""
    every = tuple(legs)
    if all(leg == (GROUND, GROUND) for leg in every):
        return "landed"
    return "brake" if (AIR, AIR) in every else "auto_land"
