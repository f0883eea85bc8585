"""Callbacks that bring each other about for ever: KYB239."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.told import Told
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import ActionUse, Callback
from kybflow.dsl.names.option_names import members, options_named


class _Said(NamedTuple):
    """An event that an action surely brings about, with the fields that are known before."""

    vehicle: str
    event: str
    fields: dict[str, str]


class _Way(NamedTuple):
    """From a callback to one that hears what `action` brings about."""

    action: ActionUse
    to: int


def circles(case: Case) -> Iterator[Diagnostic]:
    """KYB239: a callback brings about the event that it hears, itself or through others, and none
    of them has a `when` that could end it.

    In flight one round is made in each tick: nothing hangs, but the same is done again and again.
    `emit` tells its event, `log` the event `logged`, `set` `option_changed`, `switch`
    `behavior_ended` and `behavior_started`, `phase` `phase_started`.
    """
    callbacks = [c for c in case.document.callbacks if c.when is None]
    ways = _ways(case, callbacks)
    for first, out in ways.items():
        circle = _back(first, ways)
        if circle and first == min(circle):
            heard = [callbacks[index].event.text for index in (*circle, first)]
            yield Diagnostic(
                "KYB239",
                f"`{heard[0]}` is answered again and again, for ever",
                next(way.action.name.span for way in out if way.to == (*circle, first)[1]),
                label="this brings it about" if len(circle) == 1 else "this begins a circle",
                notes=() if len(circle) == 1 else ("`" + "` → `".join(heard) + "`",),
                help="add a `when`, or hear an event that this does not bring about",
            )


def _ways(case: Case, callbacks: list[Callback]) -> dict[int, list[_Way]]:
    told = Told(case)
    hearing: dict[tuple[str, str], list[int]] = {}
    for index, callback in enumerate(callbacks):
        event = callback.event.text
        for vehicle in told.tellers(event):
            name = event.partition(".")[2] if vehicle else event
            hearing.setdefault((vehicle, name), []).append(index)
    ways: dict[int, list[_Way]] = {}
    for index, callback in enumerate(callbacks):
        for action in callback.actions:
            for said in _said(case, action):
                listeners = hearing.get((said.vehicle, said.event), ())
                found = [i for i in listeners if _passes(callbacks[i], said)]
                ways.setdefault(index, []).extend(_Way(action, i) for i in found)
    return ways


def _passes(callback: Callback, said: _Said) -> bool:
    """Whether the callback's filters surely let the event through."""
    return all(said.fields.get(field.text) == value.text for field, value in callback.fields)


def _said(case: Case, action: ActionUse) -> Iterator[_Said]:
    name, target = action.name.text, action.target
    if name == "emit":
        yield _Said("", action.value.text, {})
    elif name == "log":
        yield _Said("", "logged", {})
    elif name == "set" and target is not None:
        for option in options_named(target, case.document, case.catalog).options:
            vehicle = option.name.partition(".")[0]
            yield _Said(vehicle, "option_changed", {"option": option.name, "by": "callback"})
    elif name == "switch" and target is not None:
        for vehicle in members(case.document, target.text):
            state = case.document.vehicles[vehicle].goal(action.value.text)
            yield _Said(vehicle, "behavior_started", {"behavior": state})
            yield _Said(vehicle, "behavior_ended", {"how": "asked"})
    elif name == "phase":
        known = {} if target is None else {"flow": target.text}
        yield _Said("", "phase_started", {**known, "phase": action.value.text})


def _back(first: int, ways: dict[int, list[_Way]]) -> list[int]:
    """The shortest circle through `first`, from it on; empty when there is none."""
    came: dict[int, int] = {}
    waiting = [first]
    for index in waiting:
        for way in ways.get(index, ()):
            if way.to == first:
                return _path(first, index, came)
            if way.to not in came:
                came[way.to] = index
                waiting.append(way.to)
    return []


def _path(first: int, last: int, came: dict[int, int]) -> list[int]:
    path = [last]
    while path[-1] != first:
        path.append(came[path[-1]])
    return path[::-1]
