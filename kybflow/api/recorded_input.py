"""Records an input of a mission without flying."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

from kybflow.core.errors import DriverError, KybflowError
from kybflow.core.signals import NS, InputReading, Time
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import InputPlan, Plan
from kybflow.inputs.rows import InputRow, head, line
from kybflow.recording.run_folder import GrowingFile, RunUnwritten
from kybflow.runtime.clock import Clock, WallClock
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.inputs import Inputs

RATE = 250
"""Sampling rate, Hz."""
Shown = Callable[[Time, InputReading | None, str], None]
"""Called with each change: the time, the reading (None if there is none), and why there is none."""


class InputUnknown(KybflowError):
    """The mission has no input of the given name; or no name was given, and it has none or
    several."""


def input_named(plan: Plan, name: str | None) -> InputPlan:
    """Return the plan's input with the given name; without a name, its only input. Raises
    InputUnknown."""
    inputs = {own.name: own for own in plan.inputs}
    if name is None and len(inputs) == 1:
        [name] = inputs
    if name in inputs:
        return inputs[name]
    if not inputs:
        raise InputUnknown("the mission has no inputs")
    if name is None:
        raise InputUnknown(f"the mission has several inputs: {', '.join(inputs)}")
    raise InputUnknown(f"the mission has no input `{name}`; {did_you_mean(name, inputs)}")


def record_input(
    plan: InputPlan, out: Path, seconds: float | None, shown: Shown, clock: Clock | None = None
) -> int:
    """Record an input into the table `out` and return the number of rows. Recording ends after
    `seconds` or with a KeyboardInterrupt. Raises DriverError if the device can't be opened,
    RunUnwritten if the table can't be written."""
    axes: tuple[str, ...] = plan.part.cls.axes(plan.part.params)
    rows = 0

    def note(_: str, now: Time, reading: InputReading | None, why: str) -> None:
        nonlocal rows
        row = InputRow(now, {}, lost=why) if reading is None else InputRow(now, *reading[1:3])
        file.write(line(row, axes).encode())
        shown(now, reading, why)
        rows += 1

    # the device opens before the table is emptied
    device = closing(plan.part.cls.open(plan.part.params, _no_sticks))
    with (
        suppress(KeyboardInterrupt),
        device as link,
        closing(GrowingFile.of_run(out, "table")) as file,
    ):
        clock = WallClock(RATE) if clock is None else clock
        file.write(head(axes).encode())
        inputs = Inputs((plan,), {plan.name: link}, Events(), note)
        try:
            while seconds is None or clock.now < seconds * NS:
                inputs.step(clock.now)
                clock.step()
        finally:
            inputs.end(clock.now + NS // RATE, "the record ended")
    if file.failed is not None:
        raise RunUnwritten(file.failed)
    return rows


def _no_sticks(vehicle: str) -> None:
    raise DriverError(
        f"the sticks of `{vehicle}` are available only in a run, which records them in its "
        "folder `inputs/`"
    )
