"""The commands that are legal now, each with its key.

A few letters have the same meaning in every run. Events, states and phases of the mission get the
digits and then the other letters, in order. They keep their keys, so that no key changes its
meaning while a person presses it.
"""

from __future__ import annotations

import string
from collections.abc import Iterator
from math import inf
from typing import NamedTuple

from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import Emit, EnterPhase, Stop, Switch
from kybflow.runtime.commanding.orders import (
    COMMANDS,
    PREFIX,
    LandOrder,
    Order,
    PauseOrder,
    ResetOrder,
    ResumeOrder,
    text,
)
from kybflow.runtime.commanding.situation import Situation

FIXED: dict[str, Order] = {
    "p": PauseOrder(),
    "l": LandOrder(),
    "r": ResumeOrder(),
    "x": ResetOrder(),
    "s": Stop(""),
}
AT_ONCE = (PauseOrder, LandOrder)
"""The orders that are sent at once; all others wait for Enter."""
KEYS = tuple(key for key in string.digits[1:] + string.ascii_letters if key not in FIXED)
_OF_ANY_VEHICLE = frozenset({"hover", "auto_home"})
"""The built-in states that have a key. `land` and the failsafes lead to the others."""


class Offer(NamedTuple):
    """A command that is legal now. group: empty, `events`, a vehicle or a flow. key: empty if all
    keys are taken."""

    group: str
    name: str
    order: Order
    key: str = ""


class OfferedKeys:
    """Assigns keys to commands. If all keys are taken, a new command takes the key of the one that
    has been illegal for longest, provided that this is more than `rest` seconds."""

    def __init__(self, rest: float = 10.0) -> None:
        self._rest = rest
        self._keys: dict[Order, str] = {}
        self._legal: dict[Order, float] = {}

    def assign(self, situation: Situation, now: float) -> tuple[Offer, ...]:
        """Return the commands that are legal at time `now` (s), with their keys."""
        free = [key for key in KEYS if key not in self._keys.values()]
        legal = []
        for offer, is_legal in _known(situation):
            if offer.order not in self._keys and free:
                self._keys[offer.order] = free.pop(0)
            if is_legal:
                legal.append(offer)
                self._legal[offer.order] = now
        return (
            *_fixed(situation),
            *(offer._replace(key=self._key(offer.order, now)) for offer in legal),
        )

    def _key(self, order: Order, now: float) -> str:
        if order not in self._keys:
            oldest = min(self._keys, key=self._last_legal)
            if now - self._last_legal(oldest) <= self._rest:
                return ""
            self._keys[order] = self._keys.pop(oldest)
        return self._keys[order]

    def _last_legal(self, order: Order) -> float:
        return self._legal.get(order, -inf)


def _fixed(situation: Situation) -> Iterator[Offer]:
    vehicles = situation.vehicles
    legal = {
        "p": any(v.pause is None and "pause" not in v.holders for v in vehicles),
        "l": any(v.land is None and v.retired is None for v in vehicles),
        "r": any(v.resume is None for v in vehicles),
        "x": any(v.reset is None and (v.state == "fault" or v.latched) for v in vehicles),
        "s": True,
    }
    for key, order in FIXED.items():
        name = text(order)
        if legal[key] or situation.emit.get(f"{PREFIX}{name}", False):
            yield Offer("", name, order, key)


def _known(situation: Situation) -> Iterator[tuple[Offer, bool]]:
    """Yield every possible command except the fixed ones, and whether it is legal now."""
    for name, waits in situation.emit.items():
        if name not in COMMANDS:
            yield Offer("events", name, Emit(name)), waits
    for vehicle in situation.vehicles:
        states: dict[str, bool] = {}  # a chain counts as one state
        for state, reason in vehicle.enter.items():
            if state not in BUILT_IN or state in _OF_ANY_VEHICLE:
                states.setdefault(state.partition(".")[0], reason is None)
        for state, is_legal in states.items():
            offer = Offer(vehicle.name, state, Switch(vehicle.name, state))
            yield offer, is_legal and state != vehicle.state
    for flow in situation.flows:
        for phase, reason in flow.enter.items():
            offer = Offer(flow.name, phase, EnterPhase(flow.name, phase))
            yield offer, reason is None and phase != flow.phase
