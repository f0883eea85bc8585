"""What people, flows and callbacks ask of a vehicle, until its next `act` decides it."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from kybflow.core.signals import Reaction
from kybflow.dsl.plan import StatePlan
from kybflow.parts import AIR, GROUND, MOVING, Flight


class Asker(IntEnum):
    """Who asks; when several do in one tick, the lowest is heard."""

    OPERATOR = 0
    FLOW = 1
    CALLBACK = 2


class Wish(NamedTuple):
    """To enter `state`; `at` is the mission line that asks."""

    state: str
    by: Asker
    at: str


class Wishes:
    """The queue of one vehicle: orders, and switches to a state, of which one is chosen.
    `waiting` tells whether there are any."""

    __slots__ = ("_orders", "_switches", "waiting")

    def __init__(self) -> None:
        self.waiting = False
        self._switches: list[Wish] = []
        self._orders: list[Callable[[], None]] = []

    def switch(self, wish: Wish) -> None:
        self._switches.append(wish)
        self.waiting = True

    def order(self, order: Callable[[], None]) -> None:
        self._orders.append(order)
        self.waiting = True

    def obey(self) -> None:
        """Do every order, the oldest first."""
        orders, self._orders = self._orders, []
        for order in orders:
            order()

    def taken(self) -> tuple[Wish | None, list[Wish]]:
        """(the wish that is heard, those that lose to it); nothing waits any more. Of one asker the
        first is heard; who asks for the same state as the winner does not lose."""
        asked, self._switches, self.waiting = self._switches, [], bool(self._orders)
        first = min(asked, key=lambda wish: wish.by, default=None)
        return first, [w for w in asked if first is not None and w.state != first.state]


_SAFER = {
    "auto_home": Reaction.GO_HOME,
    "auto_land": Reaction.LAND,
    "land_blind": Reaction.LAND_BLIND,
}
"""The states that make any vehicle safer, and how severe a reaction entering one amounts to."""


def severity(state: str) -> Reaction | None:
    """The reaction that entering `state` amounts to, None where it is no reaction's state."""
    return _SAFER.get(state)


def comes_down(state: StatePlan) -> bool:
    """Whether `state` makes a flying vehicle safer: it leads home, or only to the ground."""
    airborne = [leg for leg in state.legs if leg.start is not GROUND]
    lands = bool(airborne) and all(leg.end is GROUND for leg in airborne)
    return lands or state.name in _SAFER


def unfit(state: StatePlan, flight: Flight, estimated: bool) -> str | None:
    """Why the behavior of `state` can't start where the vehicle is, None when it can."""
    name, cls = state.behavior.name, state.behavior.cls
    if all(leg.start is not flight for leg in state.legs):
        where = {GROUND: "on the ground", AIR: "in the air", MOVING: "between ground and air"}
        return f"`{name}` can't start while the vehicle is {where[flight]}"
    if cls.needs_estimate and not estimated:
        return f"`{name}` can't start without an estimate"
    return None
