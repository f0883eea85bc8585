"""The control rate of a mission that says nothing of it."""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.dsl.document import PartUse

CONTROL_RATE = 250
"""Hz."""


def needed_rate(drivers: Iterable[PartUse]) -> int:
    """The lowest (Hz) that all drivers are content with; where it does not fall on the steps of
    each of them, the usual one that does. Where that doesn't either, KYB303 tells so."""
    used = [(use.spec.cls, use.params) for use in drivers]
    needed = max((driver.control_rate(params) for driver, params in used), default=CONTROL_RATE)
    steps = [rate for driver, params in used if (rate := driver.step_rate(params)) is not None]
    fitting = (r for r in (needed, CONTROL_RATE) if all(divides(r, step) for step in steps))
    return next(fitting, needed)


def divides(control: int, steps: float) -> bool:
    """Whether every tick at `control` falls on a step, of `steps` a second."""
    each = round(steps / control)
    return each >= 1 and abs(steps / control - each) < 1e-9
