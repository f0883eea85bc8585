"""Inputs and the vehicles that they steer: KYB401 to KYB407, KYB409 and
KYB447."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.core.params import named_in
from kybflow.core.signals import kind_name
from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION
from kybflow.dsl.checks.case import WORDS, Case, taken_names, transitions_of
from kybflow.dsl.checks.conditions import conditions_of, nodes
from kybflow.dsl.diagnostics import Diagnostic, Severity, Text
from kybflow.dsl.expressions import Axis
from kybflow.dsl.expressions.tree import quantity
from kybflow.dsl.names import no_vehicles
from kybflow.dsl.plan import StatePlan
from kybflow.dsl.reading.nodes import Scalar, entries_of

LOST = "input_lost"


class _Steered(NamedTuple):
    """A state whose behavior is steered by an input. input: the name of the input as written."""

    state: StatePlan
    input: Text


def _steered(case: Case) -> Iterator[_Steered]:
    for _, state in case.states():
        for parameter, name in named_in(state.behavior.params, "input").items():
            span = state.behavior.span_of(parameter)
            yield _Steered(state, Text(name, span))


def unknown_inputs(case: Case) -> Iterator[Diagnostic]:
    """KYB401: a behavior names an input that does not exist, or an input names a vehicle that does
    not exist."""
    known = case.plan.inputs_by_name
    for _, name in case.cached(_steered):
        if name.text not in known:
            message = f"the mission has no input `{name.text}`"
            hint = did_you_mean(name.text, known) if known else ""
            hint = hint or f"declare it: `inputs: {{{name.text}: {{use: gamepad}}}}`"
            yield Diagnostic("KYB401", message, name.span, label="unknown", help=hint)
    for use in case.plan.inputs:
        yield from no_vehicles("KYB401", use.part, case.plan)


def missing_axes(case: Case) -> Iterator[Diagnostic]:
    """KYB402: an input lacks an axis that a behavior needs."""
    for state, name in case.cached(_steered):
        use = case.plan.inputs_by_name.get(name.text)
        lacking = [a for a in state.behavior.cls.axes if use is not None and a not in use.axes]
        if use is not None and lacking:
            axes = ", ".join(f"`{name}`" for name in use.axes) or "none"
            yield Diagnostic(
                "KYB402",
                f"`{name.text}` has no axis `{lacking[0]}`",
                name.span,
                label=f"`{state.behavior.name}` needs it",
                notes=(f"`{name.text}` ({use.part.name}) is at {use.part.span.at}",),
                help=f"use another input: the axes of this one are {axes}",
            )


def unknown_buttons(case: Case) -> Iterator[Diagnostic]:
    """KYB403: `buttons` or `dead_man` names a button that the input doesn't have."""
    for use in case.plan.inputs:
        device, buttons = use.part.cls.buttons(use.part.params), use.entry("buttons")
        named = () if buttons is None else entries_of(buttons.value).values()
        texts = [one.value.as_text for one in named if isinstance(one.value, Scalar)]
        wrong = [(name, device) for name in texts if name.text not in device]
        known, dead_man = tuple(use.button_names.values()), use.text_of("dead_man")
        if dead_man is not None and dead_man.text not in known:
            wrong.append((dead_man, known))
        for name, choices in wrong:
            message = f"`{use.part.name}` has no button `{name.text}`"
            hint = did_you_mean(name.text, choices) if choices else "it has no buttons"
            yield Diagnostic("KYB403", message, name.span, label="unknown", help=hint)


def unused_inputs(case: Case) -> Iterator[Diagnostic]:
    """KYB404: an input is unused: no behavior is steered by it, and nothing uses its buttons or
    axes (a warning)."""
    events = [transition.event for transition in transitions_of(case.plan)]
    events += [callback.event for callback in case.plan.callbacks]
    used = {name.text for _, name in case.cached(_steered)}
    used |= {event.partition(".")[0] for event in events if event}
    for typed in case.cached(conditions_of) if case.plan.inputs else ():
        used |= {node.input for node in nodes(typed.condition) if isinstance(node, Axis)}
    for use in case.plan.inputs:
        if use.name not in used:
            yield Diagnostic(
                "KYB404",
                f"nothing uses the input `{use.name}`",
                use.span,
                help=f"steer by it (`input: {use.name}`), use one of its buttons, or remove it",
                severity=Severity.WARNING,
            )


def lost_without_a_way_out(case: Case) -> Iterator[Diagnostic]:
    """KYB405: a steered behavior doesn't say what follows when its input is lost.

    A device may be unplugged, its battery may be empty, the person may leave. The vehicle brakes at
    once, and the behavior fails if the input stays lost; `failed` says what follows. A `next` that
    waits for `input_lost` also works.
    """
    for state, name in case.cached(_steered):
        own = state.transitions
        if any(t.cause == "failed" or t.event == LOST for t in own):
            continue
        yield Diagnostic(
            "KYB405",
            f"the mission doesn't say what follows when `{name.text}` is lost",
            state.behavior.span,
            label="the vehicle would only brake",
            help="write what follows, such as `failed: down`",
        )


def input_names(case: Case) -> Iterator[Diagnostic]:
    """KYB406: an input has the name of a vehicle, a group, a flow or a reserved word, so
    `NAME.x` would be ambiguous."""
    plan = case.plan
    taken = taken_names(plan, (plan.flows_by_name, "a flow"))
    taken |= dict.fromkeys(WORDS, "a reserved word")
    for use in plan.inputs:
        if use.name in taken:
            message, hint = f"an input can't be called `{use.name}`", "give it another name"
            yield Diagnostic("KYB406", message, use.span, label=taken[use.name], help=hint)


def not_as_told(case: Case) -> Iterator[Diagnostic]:
    """KYB407: an input can't work with its parameters: its device has no such axis, or one source
    moves two axes. It is a warning if the input can work, but probably not as intended."""
    for use in case.plan.inputs:
        objection = use.part.cls.objection(use.part.params)
        if objection is not None:
            span = use.part.span_of(objection.parameter)
            severity = Severity.WARNING if objection.is_doubt else Severity.ERROR
            yield Diagnostic(
                "KYB407", objection.reason, span, help=objection.hint, severity=severity
            )


def reported_by_nobody(case: Case) -> Iterator[Diagnostic]:
    """KYB409: an input comes from a vehicle whose driver doesn't report it. An input of the whole
    mission is only checked if the mission has no `targets`, because another driver may report
    it."""
    for use in case.plan.inputs:
        kind = use.part.cls.reported_as
        vehicle = case.plan.fleet.get(use.part.params.vehicle) if kind is not None else None
        if kind is None or vehicle is None or kind in vehicle.driver.cls.provides:
            continue
        targets = case.plan.entry("targets")
        own = None if targets is None else entries_of(targets.value).get(case.plan.target)
        if targets is None or (own is not None and use.part.span.is_in(own.value.span)):
            yield Diagnostic(
                "KYB409",
                f"`{vehicle.name}` doesn't report `{use.name}`",
                use.part.span,
                label=f"its driver `{vehicle.driver.name}` gives no {kind_name(kind)}",
                help="use another input, such as `gamepad`",
            )


_MAX_SILENCE_S = 5.0
"""The longest time for which a vehicle may be steered by the last values of an input, s."""


def silent_for_long(case: Case) -> Iterator[Diagnostic]:
    """KYB447: an input that falls silent keeps steering with its last values for more than 5 s (a
    warning)."""
    steering = {name.text for _, name in case.cached(_steered)}
    for use in case.plan.inputs:
        if use.name in steering and use.silent_after > _MAX_SILENCE_S:
            silent = quantity(use.silent_after, DURATION)
            yield Diagnostic(
                "KYB447",
                f"`{use.name}` keeps steering for {silent} after it falls silent",
                use.span_of("silent_after"),
                help="write a shorter time, such as `silent_after: 300 ms`",
                severity=Severity.WARNING,
            )
