"""Whether a tracker's gains suit the inner loop that it commands: KYB323 and KYB324."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import radians
from typing import NamedTuple

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.estimators import latency_allowed
from kybflow.dsl.checks.space import the_loop
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.loops.margins import Margins, in_words
from kybflow.flight.loops.position_loop import (
    ASKED,
    LEAST,
    PLANNED,
    OuterLoop,
    asked_of,
    designed,
    holds,
    margins_of,
    quickest_observer,
)
from kybflow.world.vehicle_context import InnerLoop, attitude_loop

GAINS, MATRIX = ("proportional", "derivative", "integral"), "position_gain"
_RATE_GAINS = (12.0, 18.0, 24.0, 32.0, 48.0, 64.0)
_DAMPED = 3.0
"""The rate gain divided by the attitude gain, for a damping of 0.87."""
_SWINGS = Margins(1.1, radians(10.0), 0.0)
"""Margins below which a loop oscillates for long after each disturbance."""


class _Closed(NamedTuple):
    """A vehicle's position loop. is_chosen: whether the gains are the author's or derived from the
    loop, and not the tracker's defaults."""

    vehicle: VehiclePlan
    outer: OuterLoop
    inner: InnerLoop
    margins: Margins
    is_chosen: bool


def _loops(case: Case) -> Iterator[_Closed]:
    """Yield the position loop of each vehicle for which it is known."""
    period = 1.0 / case.plan.control_rate
    for vehicle in case.plan.vehicles:
        driver, tracker, airframe = vehicle.driver, vehicle.tracker, vehicle.airframe
        inner = driver.cls.inner_loop(driver.params, airframe)
        if inner is None or latency_allowed(case, vehicle) is not None:
            continue
        outer = tracker.cls.outer_loop(tracker.params, airframe, inner, period)
        if outer is not None:
            found = margins_of(outer, inner)
            is_chosen = outer.stiffness is not None or any(
                gain.default is None or getattr(tracker.params, gain.name) != gain.default
                for gain in tracker.fields
                if gain.name in GAINS
            )
            yield _Closed(vehicle, outer, inner, found, is_chosen)


def gains_that_oscillate(case: Case) -> Iterator[Diagnostic]:
    """KYB323: with a tracker's gains the vehicle would oscillate, or almost.

    The gain margin is below 1.4 (3 dB), the phase margin below 15 degrees, or the delay margin
    below 5 ms.

    The margins are those of the linear loop, with the on-board attitude loop that the airframe
    declares and the delays that the driver declares. A tracker's default gains only get a warning
    (KYB324).
    """
    for loop in case.cached(_loops):
        if loop.is_chosen and not holds(loop.margins, LEAST):
            yield _finding("KYB323", loop)


def gains_near_the_limit(case: Case) -> Iterator[Diagnostic]:
    """KYB324: a tracker's gains leave little margin: a gain margin below 2 (6 dB), a phase margin
    below 30 degrees or a delay margin below 20 ms (a warning).

    If even the gains derived from the loop have a gain margin below 2, theirs is the bound. A
    tracker's default gains are reported only if they fail the bounds of KYB323.
    """
    for loop in case.cached(_loops):
        is_refused = loop.is_chosen and not holds(loop.margins, LEAST)
        if is_refused or holds(loop.margins, ASKED):
            continue
        bound = asked_of(loop.outer, loop.inner) if loop.is_chosen else LEAST
        if not holds(loop.margins, bound):
            yield replace(_finding("KYB324", loop), severity=Severity.WARNING)


def _finding(code: str, loop: _Closed) -> Diagnostic:
    tracker, name = loop.vehicle.tracker, loop.vehicle.name
    bound = asked_of(loop.outer, loop.inner)
    what = f"would make `{name}` oscillate"
    if holds(loop.margins, _SWINGS):
        little = "little" if code == "KYB324" else "too little"
        what = f"leaves `{name}` {little} stability margin"
    hint, notes = _way_out(loop, bound), [f"required: at least {in_words(bound)}"]
    if loop.outer.stiffness is not None and loop.outer.stiffness.is_coupled:
        notes.append(f"estimated, because `{MATRIX}` couples height with x and y")
    keys = ("observer",) if "`observer: " in hint else (MATRIX, *GAINS, "observer")
    written = (key for key in keys if tracker.is_written(key))
    return Diagnostic(
        code,
        f"`{tracker.name}` {what}",
        tracker.span_of(next(written, "")),
        label=in_words(loop.margins),
        notes=tuple(notes),
        help=hint,
        related=the_loop(loop.vehicle),
    )


def _on_board(outer: OuterLoop, inner: InnerLoop) -> str:
    """Return the help line for an on-board loop that no position gains suit: the gains of a
    well-damped cascade that the highest position gains suit."""
    found = []
    for rate in _RATE_GAINS:
        loop = attitude_loop(inner.rotor_time, rate / _DAMPED, rate)
        other = inner._replace(attitude=loop)
        gains = designed(outer, other)
        if holds(margins_of(outer.with_gains(*gains), other), PLANNED):
            found.append((gains, -rate))
    if not found:
        return (
            "no gains suit these delays and rotors: reduce the delays, or the airframe's"
            " `rotor_time`"
        )
    rate = -max(found)[1]
    return (
        "no gains suit this attitude loop: write the airframe's"
        f" `attitude_gain: {rate / _DAMPED:.3g} 1/s` and `rate_gain: {rate:.3g} 1/s`"
    )


def _way_out(loop: _Closed, bound: Margins) -> str:
    """Return the help line: the largest gains with the planned margins, or the fastest observer."""
    outer, inner = loop.outer, loop.inner
    if not loop.is_chosen:
        return "use a tracker that derives its gains from the loop, such as `geometric`"
    if holds(margins_of(outer._replace(observer=0.0), inner), bound):
        return f"write at most `observer: {quickest_observer(outer, inner, bound):g} Hz`"
    gains = designed(outer, inner)
    if not holds(margins_of(outer.with_gains(*gains), inner), PLANNED):
        return _on_board(outer, inner)
    if outer.stiffness is not None:
        k, d, i = (f"{gain:.3g}" for gain in gains)
        start = f"[[{k}, 0, 0], [0, {k}, 0], [0, 0, {k}]]"
        return f"start at `{MATRIX}: {start}`, `derivative: {d}`, `integral: {i}`"
    if outer.proportional != loop.vehicle.tracker.params.proportional:
        return "use smaller gains: start with half of them"
    return "use at most " + ", ".join(f"`{n}: {v:.3g}`" for n, v in zip(GAINS, gains, strict=True))
