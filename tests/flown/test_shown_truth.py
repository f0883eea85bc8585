"""A vehicle on a simulator that only shows where it is, seen by simulated motion capture."""

from __future__ import annotations

from typing import Any

from plans import part, vehicle, wrapped
from short_flights import down, hold, up

from kybflow.core.signals import Pose, Truth
from kybflow.dsl.plan import SensorPlan
from kybflow.parts import Link


class Shown(Link):
    """A simulated vehicle whose driver has no motion capture."""

    def __init__(self, link: Link) -> None:
        self.link, self.faults = link, link.faults

    def read(self, now: int) -> list[Any]:
        return [m for m in self.link.read(now) if not isinstance(m, Pose)]

    def send(self, command: Any, now: int) -> None:
        self.link.send(command, now)

    def subscribe(self, kinds: Any) -> None:
        self.link.subscribe(kinds)

    def truth(self) -> Truth | None:
        return self.link.truth()


def test_a_vehicle_flies_by_it(run) -> None:
    sensor = SensorPlan(part("sensors", "simulated_motion_capture"), ("mocap",))
    driver = wrapped(lambda _, link: Shown(link))
    states = [up("hold"), hold(2.0, "down"), down()]
    flown, _ = run(vehicle("a", states, driver=driver, sensors=(sensor,)))
    assert flown.summary["outcome"] == "succeeded"
    scores = {b["name"]: b for b in flown.summary["vehicles"]["a"]["behaviors"]}
    assert scores["hold"]["position_error_m"]["max"] < 0.04
