"""Nothing that flies reads the simulator's truth: a truth that lies changes no command. A
vehicle on a simulator that only shows where it is flies by simulated motion capture."""

from __future__ import annotations

from typing import Any

import pytest
from plans import Through, part, state, then, vehicle, wrapped
from short_flights import down, hovers, path, up

from kybflow.core.signals import Command, Pose, Truth
from kybflow.dsl.plan import SensorPlan

LIE = Truth((9.0, 9.0, 9.0), (5.0, 5.0, 5.0), (0.0, 1.0, 0.0, 0.0), (7.0, 7.0, 7.0))


def commands(run, lies: bool) -> list[Command]:
    told: list[Command] = []

    class Watched(Through):
        def send(self, command, now):
            told.append(command)
            super().send(command, now)

        def truth(self):
            truth = super().truth()
            return LIE if lies else truth

    driver = wrapped(lambda _, link: Watched(link))
    eight = part("behaviors", "figure_eight", width=1.0, lap=8.0)
    states = [up("eight"), state("eight", eight, then("down")), down()]
    _, heard = run(vehicle("a", states, driver=driver))
    assert path(heard, "a") == ["up", "eight", "down", "landed"]
    return told


@pytest.mark.thorough
def test_a_truth_that_lies_changes_no_command(run):
    honest = commands(run, lies=False)
    assert len(honest) > 2000
    assert commands(run, lies=True) == honest


class Shown(Through):
    """A simulated vehicle whose driver has no motion capture."""

    def read(self, now: int) -> list[Any]:
        return [m for m in super().read(now) if not isinstance(m, Pose)]


def test_a_vehicle_flies_by_it(run) -> None:
    sensor = SensorPlan(part("sensors", "simulated_motion_capture"), ("mocap",))
    driver = wrapped(lambda _, link: Shown(link))
    flown, _ = run(hovers(2.0, driver=driver, sensors=(sensor,)))
    assert flown.summary["outcome"] == "succeeded"
    scores = {b["name"]: b for b in flown.summary["vehicles"]["a"]["behaviors"]}
    assert scores["hold"]["position_error_m"]["max"] < 0.04
