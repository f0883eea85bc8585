"""Callbacks: their filters, the events that they emit, their log texts, and cycles among them:
KYB230 to KYB239."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from string import Formatter
from typing import NamedTuple, get_args

from kybflow.core.events import AlarmRaised
from kybflow.core.names import NAME
from kybflow.core.signals import ExitName, ReactionName
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.actions import actions_of
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.events import OPERATOR, KnownEvents, emitted_by_transitions, known_events
from kybflow.dsl.diagnostics import Collector, Diagnostic, Span, Text
from kybflow.dsl.names import BUILT_IN, options_named
from kybflow.dsl.plan import ActionKeys, CallbackPlan, Plan, VehiclePlan
from kybflow.dsl.reading.nodes import entries_of, items_of
from kybflow.parts.events import AWAITED_EVENTS

_CUSTOM = re.compile(rf"{NAME}(\.{NAME})*\Z")
_PLACEHOLDER = re.compile(rf"{NAME}\Z")
_ALWAYS = ("event", "time")
_NUMBERS = frozenset({"bound", "offset"})
_OF_ALARMS = tuple(AlarmRaised.fields)


def filters(case: Case) -> Iterator[Diagnostic]:
    """KYB231: a callback filters by a field that its event does not have, or by a value that never
    occurs.

    The table of events lists the fields of each. What they name is checked: states, estimators,
    reactions, how a behavior ended, and so on. Numbers can't be filtered: compare them in a `when`.
    """
    (events,) = case.cached(known_events)
    for callback in case.plan.callbacks:
        if not callback.event:
            continue
        sources = events.sources(callback.event)
        known = carried(callback.event, events)
        for field, _ in callback.fields if sources else ():
            if field not in known:
                message = f"`{callback.event}` has no field `{field}`"
                span = callback.key_span(field)
                hint = did_you_mean(field, known) or "this event has no fields"
                yield Diagnostic("KYB231", message, span, label="unknown", help=hint)
            elif field in _NUMBERS or (field == "value" and known == _OF_ALARMS):
                message = f"`{field}` is a number, but a filter compares names"
                span = callback.key_span(field)
                yield Diagnostic("KYB231", message, span, help="compare it in a `when` instead")
            else:
                yield from _never_said(case, sources, field, callback.text_of(field))


_Vehicles = list[VehiclePlan]
_NAMES: dict[str, Callable[[Plan, _Vehicles], Iterable[str]]] = {
    "behavior": lambda _, own: [*BUILT_IN, *(name for v in own for name in v.states)],
    "state": lambda _, own: [*BUILT_IN, *(name for v in own for name in v.states)],
    "estimator": lambda _, own: [use.part.alias for v in own for use in v.estimators],
    "previous": lambda _, own: [use.part.alias for v in own for use in v.estimators],
    "processor": lambda _, own: [part.alias for v in own for part in v.processors],
    "camera": lambda _, own: [name for v in own for name in v.own_cameras],
    "neighbour": lambda plan, _: plan.fleet,
    "other": lambda plan, _: plan.fleet,
    "reaction": lambda _, __: get_args(ReactionName),
    "how": lambda _, __: get_args(ExitName),
    "flow": lambda plan, _: plan.flows_by_name,
    "phase": lambda plan, _: [name for flow in plan.flows for name in flow.phases],
    "input": lambda plan, _: plan.inputs_by_name,
    "fault": lambda plan, _: [fault.part.name for fault in plan.faults],
}
"""The names that a field can have, given the mission and the vehicles that emit the event."""


def _never_said(
    case: Case, sources: tuple[str, ...], field: str, value: Text | None
) -> Iterator[Diagnostic]:
    vehicles = [case.plan.fleet[name] for name in sources if name]
    known = set(_NAMES[field](case.plan, vehicles)) if field in _NAMES else set()
    if value is not None and known and value.text not in known:
        message = f"`{field}` is never `{value.text}` here"
        hint = did_you_mean(value.text, known)
        yield Diagnostic("KYB231", message, value.span, label="unknown", help=hint)


def emitted_names(case: Case) -> Iterator[Diagnostic]:
    """KYB236: `emit` is given an invalid name, or the name of an event that something else emits.

    The name of a mission's own event consists of letters, digits and `_`, with dots between parts.
    It can't be that of an event of the engine or of a part. It can't begin with `any.`, `operator.`
    or the name of a vehicle, a group, a flow or an input, because the event would seem to come from
    there.
    """
    names = [action.value_text for action in actions_of(case, "emit")]
    names += emitted_by_transitions(case.plan)
    if not names:
        return
    (events,) = case.cached(known_events)
    taken = {event for own in events.of.values() for event in own} | AWAITED_EVENTS.keys()
    owners = {"any", "operator", *case.plan.fleet, *case.plan.groups}
    owners.update(case.plan.flows_by_name, case.plan.inputs_by_name)
    for name in names:
        first, dot, _ = name.text.partition(".")
        message = hint = ""
        if not _CUSTOM.match(name.text):
            message = f"`{name.text}` can't be the name of an event"
            hint = "use letters, digits and `_`, with dots between parts"
        elif name.text in taken:
            message = (
                f"`{name.text}` is an event of the engine or of a part, which a mission can't emit"
            )
            hint = f"choose another name, such as `my_{name.text}`"
        elif dot and first in owners:
            who = "a person" if name.text.startswith(OPERATOR) else f"`{first}`"
            message = f"`{name.text}` would look like an event of {who}"
            hint = "begin the name with another word"
        if message:
            yield Diagnostic("KYB236", message, name.span, help=hint)


def phases(case: Case) -> Iterator[Diagnostic]:
    """KYB237: `phase` names a flow or a phase that does not exist, or a phase that several flows
    have."""
    flows = case.plan.flows_by_name
    for action in actions_of(case, "phase"):
        flow, phase = action.target, action.value_text
        owners = [name for name, f in flows.items() if phase.text in f.phases]
        if flow is not None and flow not in flows:
            message, span = f"there is no flow `{flow}`", action.target_text.span
            hint = did_you_mean(flow, flows)
            yield Diagnostic("KYB237", message, span, label="unknown", help=hint)
        elif flow is not None and flow not in owners:
            message = f"`{flow}` has no phase `{phase.text}`"
            hint = did_you_mean(phase.text, flows[flow].phases)
            yield Diagnostic("KYB237", message, phase.span, label="unknown", help=hint)
        elif not owners:
            known = [name for f in flows.values() for name in f.phases]
            hint = did_you_mean(phase.text, known) or "the mission has no `flows`"
            message = f"no flow has a phase `{phase.text}`"
            yield Diagnostic("KYB237", message, phase.span, label="unknown", help=hint)
        elif flow is None and len(owners) > 1:
            message = f"{' and '.join(f'`{name}`' for name in owners)} have a phase `{phase.text}`"
            hint = f"write `phase: {{{owners[0]}: {phase.text}}}`"
            yield Diagnostic("KYB237", message, phase.span, label="which one?", help=hint)


def logged_fields(case: Case) -> Iterator[Diagnostic]:
    """KYB238: `log` names a field that its event does not have.

    A callback with a condition and no event has `{time}`. Every event also has `{event}`, an event
    of a vehicle has `{vehicle}`, and each event has its own fields. Double a brace to print it.
    """
    (events,) = case.cached(known_events)
    for callback in case.plan.callbacks:
        if callback.event and not events.sources(callback.event):
            continue  # reported as KYB208
        known = log_fields(callback, events)
        for action in callback.do:
            if action.name == "log":
                yield from _placeholders(action.value_text, callback, known)


def log_fields(callback: CallbackPlan, events: KnownEvents) -> tuple[str, ...]:
    """Return the fields that a callback's `log` may name in braces."""
    event = callback.event
    if not event:
        return ("time",)
    sources = events.sources(event)
    own = ("vehicle",) if sources and sources != ("",) else ()
    return (*_ALWAYS, *own, *carried(event, events))


def carried(event: str, events: KnownEvents) -> tuple[str, ...]:
    """Return the fields of the event that triggers a callback; a custom event has none."""
    if event in events.custom or event.startswith(OPERATOR):
        return ()
    return events.fields_of(event.rpartition(".")[2])


def _placeholders(
    text: Text, callback: CallbackPlan, known: tuple[str, ...]
) -> Iterator[Diagnostic]:
    try:
        parsed = list(Formatter().parse(text.text))
    except ValueError:
        message, hint = "unmatched brace", "write `{{` to print a brace"
        yield Diagnostic("KYB238", message, text.span, help=hint)
        return
    behind = 0
    for _, name, form, conversion in parsed:
        if name is None:
            continue
        start = text.text.index("{" + name, behind) + 1
        behind = start + len(name)
        place = text.part(start, max(behind, start + 1))
        if form or conversion or not _PLACEHOLDER.match(name):
            message = "only the name of a field can be in braces"
            yield Diagnostic(
                "KYB238", message, place, help="write `{vehicle}`, or `{{` to print a brace"
            )
        elif name not in known:
            what = f"`{callback.event}`" if callback.event else "a condition"
            message = f"{what} has no field `{name}`"
            hint = did_you_mean(name, known)
            yield Diagnostic("KYB238", message, place, label="unknown", help=hint)


class _Said(NamedTuple):
    """An event that an action is certain to cause. fields: the values of its fields that are known
    before the flight."""

    vehicle: str
    event: str
    fields: dict[str, str]


class _Way(NamedTuple):
    """A link from one callback to another: `action` of the first causes an event that triggers the
    second. to: the number of the second callback."""

    action: ActionKeys
    to: int


def cycles(case: Case) -> Iterator[Diagnostic]:
    """KYB239: a callback causes the event that triggers it, by itself or through others, and none
    of them has a `when` that could stop it.

    In flight the cycle turns once per tick: nothing hangs, but the same actions repeat forever.
    `emit` raises its event, `log` raises `logged`, `set` raises `option_changed`, `switch` raises
    `behavior_ended` and `behavior_started`, `phase` raises `phase_started`, and `perform` raises
    `performed` or `perform_refused`.
    """
    callbacks = [c for c in case.plan.callbacks if c.when is None]
    heard_events = [c.event for c in callbacks if c.event]
    ways = _ways(case, callbacks, heard_events)
    for first, out in ways.items():
        cycle = _back(first, ways)
        if cycle and first == min(cycle):
            heard = [heard_events[index] for index in (*cycle, first)]
            onward = (*cycle, first)[1]
            action = next(way.action for way in out if way.to == onward)
            yield Diagnostic(
                "KYB239",
                f"`{heard[0]}` triggers itself again and again, forever",
                _key_span(callbacks[first], action),
                label="this causes it" if len(cycle) == 1 else "this begins a cycle",
                notes=() if len(cycle) == 1 else ("`" + "` → `".join(heard) + "`",),
                help="add a `when`, or wait for an event that this does not cause",
            )


def _key_span(callback: CallbackPlan, action: ActionKeys) -> Span:
    """Return where the key of an action is written. One key may have several targets, which are
    separate actions."""
    do = callback.entry("do")
    items = () if do is None else items_of(do.value)
    own = next(item for item in items if action.span.is_in(item.span))
    return next(iter(entries_of(own).values())).key.span


def _ways(case: Case, callbacks: list[CallbackPlan], heard: list[str]) -> dict[int, list[_Way]]:
    (events,) = case.cached(known_events)
    hearing: dict[tuple[str, str], list[int]] = {}
    for index, event in enumerate(heard):
        for vehicle in events.sources(event):
            name = event.partition(".")[2] if vehicle else event
            hearing.setdefault((vehicle, name), []).append(index)
    ways: dict[int, list[_Way]] = {}
    for index, callback in enumerate(callbacks):
        for action in callback.do:
            for said in _said(case, action):
                listeners = hearing.get((said.vehicle, said.event), ())
                found = [i for i in listeners if said.fields.items() >= set(callbacks[i].fields)]
                ways.setdefault(index, []).extend(_Way(action, i) for i in found)
    return ways


def _said(case: Case, action: ActionKeys) -> Iterator[_Said]:
    name, target, value = action.name, action.target, action.value
    if name == "emit":
        yield _Said("", value, {})
    elif name == "log":
        yield _Said("", "logged", {})
    elif name == "set" and target is not None:
        asked = action.target_text
        for option in options_named(asked, case.plan, case.catalog, Collector()):
            vehicle = option.name.partition(".")[0]
            yield _Said(vehicle, "option_changed", {"option": option.name, "by": "callback"})
    elif name == "switch" and target is not None:
        for vehicle in case.plan.members(target):
            state = case.plan.fleet[vehicle].goal(value.state)
            yield _Said(vehicle, "behavior_started", {"behavior": state})
            yield _Said(vehicle, "behavior_ended", {"how": "asked"})
    elif name == "perform" and target is not None:
        for vehicle in case.plan.members(target):
            driver = case.plan.fleet[vehicle].driver
            act = driver.cls.acts.get(value)
            can = act is not None and (act.needs is None or getattr(driver.params, act.needs))
            told = "performed" if can else "perform_refused"
            yield _Said(vehicle, told, {"act": value, "by": "callback"})
    elif name == "phase":
        known = {} if target is None else {"flow": target}
        yield _Said("", "phase_started", {**known, "phase": value})


def _back(first: int, ways: dict[int, list[_Way]]) -> list[int]:
    """Return the shortest cycle that begins at `first`; empty if there is none."""
    came: dict[int, int] = {}
    waiting = [first]
    for index in waiting:
        targets = [way.to for way in ways.get(index, ())]
        for target in targets:
            if target not in came:
                came[target] = index
                waiting.append(target)
        if first in targets:
            break
    path = [came[first]] if first in came else []
    while path and path[-1] != first:
        path.append(came[path[-1]])
    return path[::-1]
