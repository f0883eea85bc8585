"""The haptic loop closed in flight: a simulated hand steers, and feels the vehicle and the wall."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from failsafe_parts import orders
from plans import failed, on, part, state, then, vehicle
from short_flights import down, path, up

from kybflow.core.files import File
from kybflow.dsl.plan import InputPlan
from kybflow.inputs.rows import parse
from kybflow.recording.earlier_run import read_earlier_run

HAND = """\
t, x, y, z, turn, buttons
0, 0, 0, 0, 0,
7, 1, 0, 0, 0,
17, 0, 0, 0, 0,
19, 0, 0, 0, 0, end
"""


def flown_by_hand(run: Any, rate: int, **more: Any) -> dict[float, float]:
    """The force along x at each time, as a share of the largest."""
    device = part("inputs", "haptic", device="simulated", hand=File("hand.csv", "1", HAND))
    own = replace(device, label="inputs.hand")
    inputs = (InputPlan(name="hand", part=own, button_names={"end": "end"}, silent_after=0.3),)
    steered = part("behaviors", "steer", input="hand", speed=0.5)
    states = [
        up("wait", 1.0),
        state("wait", part("behaviors", "hover", for_time=0.5), then("steered")),
        state("steered", steered, on("hand.end", "down"), failed("down")),
        down(),
    ]
    flown, told = run(vehicle("a", states), inputs=inputs, control_rate=rate, **more)
    assert path(told, "a") == ["up", "wait", "steered", "down", "landed"]
    *rows, ended = parse(read_earlier_run(flown.folder).inputs["hand"]).rows
    assert ended.lost
    return {row.time / 1e9: row.axes["force_x"] for row in rows}


def between(felt: dict[float, float], begin: float, end: float) -> list[float]:
    return [force for time, force in felt.items() if begin < time < end]


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [100, 250])
def test_a_hand_feels_the_wall_that_the_vehicle_comes_to(run: Any, rate: int) -> None:
    felt = flown_by_hand(run, rate)
    free, near, rest = (between(felt, *t) for t in ((9.0, 9.5), (15.0, 16.5), (5.5, 6.5)))
    assert max(map(abs, rest)) < 0.1
    assert sum(near) / len(near) < sum(free) / len(free) - 0.2


@pytest.mark.thorough
def test_a_paused_vehicle_pushes_no_hand(run: Any) -> None:
    pausing = orders(
        (9.5, lambda v: v.requests.pause("operator", "m.yaml:3")),
        (11.0, lambda v: v.requests.resume("operator")),
    )
    felt = flown_by_hand(run, 250, observers=(pausing,))
    before, paused = between(felt, 9.0, 9.45), between(felt, 10.2, 10.9)
    assert sum(before) / len(before) < -0.1
    assert paused
    assert max(map(abs, paused)) < 0.02
