"""A planner's trajectory: followed smoothly from point to point, and what can't be flown is refused
with its reason."""

from __future__ import annotations

from math import cos, inf, nan, sin
from pathlib import Path

import pytest
from part_bench import entry, estimate
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.core.geometry import ZERO, Vec3, distance
from kybflow.core.signals import NS, Failed, PlannedPoint, Setpoint, Tick
from kybflow.runtime.behaviors.trajectory_input import TrajectoryInput, TrajectoryInputParams
from kybflow.runtime.commanding.command_queue import RecordedCommand
from kybflow.runtime.commanding.orders import TrackOrder, parse, text

DT = 0.01
HERE: Vec3 = (0.0, 0.0, 1.0)


class Flight:
    def __init__(self, **own: float) -> None:
        self.behavior = TrajectoryInput(TrajectoryInputParams(**own), entry(HERE))
        self.now, self.way, self.end = 0, [], ""

    def take(self, time: float, position: Vec3, *more: Vec3) -> str | None:
        return self.behavior.take(PlannedPoint(time, position, *more), self.now)

    def fly(self, seconds: float) -> Setpoint:
        for _ in range(round(seconds / DT)):
            self.now += round(DT * NS)
            known = estimate(HERE, now=self.now)
            output = self.behavior.update(Tick(self.now, DT, self.now / NS, known, None, None, {}))
            if isinstance(output, Failed):
                self.end, output = output.reason, output.setpoint
            self.way.append(output)
        return self.way[-1]


def test_it_goes_through_every_point_without_a_step() -> None:
    flight = Flight()
    for n in range(1, 9):
        a = 0.5 * n
        p = (0.4 * sin(a), 0.4 - 0.4 * cos(a), 1.0)
        assert flight.take(n, p, (0.2 * cos(a), 0.2 * sin(a), 0.0)) is None
    for n in range(1, 8):
        a = 0.5 * n
        setpoint = flight.fly(1.0)
        assert setpoint.position == pytest.approx((0.4 * sin(a), 0.4 - 0.4 * cos(a), 1.0), abs=1e-6)
        assert setpoint.velocity == pytest.approx((0.2 * cos(a), 0.2 * sin(a), 0.0), abs=1e-6)
    for before, after in zip(flight.way, flight.way[1:], strict=False):
        assert distance(before.velocity or ZERO, after.velocity or ZERO) < 2.0 * DT


@pytest.mark.parametrize(
    ("time", "position", "reason"),
    [
        (2.0, (nan, 0.0, 1.0), "not finite"),
        (inf, (0.0, 0.0, 1.0), "not finite"),
        (0.9, (0.0, 0.0, 1.0), "stale: the time is 1.000 s"),
        (1.5, (0.3, 0.0, 1.0), "not later than the last point, of 1.500 s"),
        (2.0, (2.0, 0.0, 1.0), "needs 3.80 m/s, 1 are allowed"),
        (9.0, (3.5, 0.0, 1.0), "0.50 m outside the fence"),
        (20.0, (0.1, 0.0, 1.0), "19.0 s ahead, 10 s are allowed"),
    ],
)
def test_what_cannot_be_flown_is_refused(time: float, position: Vec3, reason: str) -> None:
    flight = Flight()
    flight.fly(1.0)
    if time != 0.9:
        assert flight.take(1.5, (0.1, 0.0, 1.0)) is None
    assert reason in str(flight.take(time, position))


def test_it_brakes_after_the_last_point_and_fails_when_none_comes() -> None:
    flight = Flight(timeout=1.0)
    assert flight.take(1.0, (0.4, 0.0, 1.0), (0.4, 0.0, 0.0)) is None
    flight.fly(1.9)
    assert flight.end == ""
    assert flight.way[-1].velocity == pytest.approx(ZERO)
    flight.fly(0.2)
    assert flight.end == "no point has arrived for 1 s"


def test_a_point_has_one_spelling() -> None:
    order = parse("track mk time=1.25 position=[1, -2.5, 1.2] heading=0.5")
    assert order == TrackOrder("mk", PlannedPoint(1.25, (1.0, -2.5, 1.2), heading=0.5))
    assert parse(text(order)) == order


MISSION = """
kybflow: 1
mission: planned
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: plan, within: 15 s}
      plan: {do: trajectory_input, timeout: 3 s, failed: down, next: [{after: 60 s, go: down}]}
      down: {do: land}
"""


@pytest.mark.thorough
def test_a_planner_flies_a_vehicle_by_commands_that_are_recorded(tmp_path: Path) -> None:
    plan = compiled(tmp_path / "planned.yaml", MISSION)
    commands = (
        "track a time=10.0 position=[0.8, 0, 1.2] velocity=[0.2, 0, 0]",
        "track a time=9.0 position=[0, 0, 1.2]",
        "track a time=12.0 position=[0.8, 0.8, 1.2]",
    )
    again = tuple(RecordedCommand(6 * NS, words, "planner", False) for words in commands)
    flown = fly(plan, RunRequest(out=tmp_path / "run", again=again))
    events = (flown.folder / "events.jsonl").read_text()
    assert flown.exit_code == 0
    assert '"command_given"' in events
    assert "it is not later than the last point, of 10.000 s" in events
    assert "no point has arrived for 3 s" in events


@pytest.mark.parametrize("ahead", [1, 4, 20])
@pytest.mark.parametrize("tells_velocity", [False, True])
def test_what_a_stream_leaves_out_is_fitted(ahead: int, tells_velocity: bool) -> None:
    """A circle at 20 Hz, sent one point or more ahead."""

    def at(time: float) -> Vec3:
        return (0.5 * sin(time), 0.5 - 0.5 * cos(time), 1.0)

    def speed(time: float) -> Vec3:
        return (0.5 * cos(time), 0.5 * sin(time), 0.0)

    flight, sent, off = Flight(), 0, []
    assert flight.take(2.0, at(0.0), speed(0.0), (0.0, 0.5, 0.0)) is None
    flight.fly(1.5)
    for _ in range(round(4.0 / DT)):
        while flight.now / NS + 0.05 * ahead > 2.0 + 0.05 * sent:
            sent += 1
            given = (speed(0.05 * sent),) if tells_velocity else ()
            assert flight.take(2.0 + 0.05 * sent, at(0.05 * sent), *given) is None
        setpoint = flight.fly(DT)
        time = flight.now / NS - 2.0
        if time > 0.5:
            off.append(distance(setpoint.velocity, speed(time)))
            assert distance(setpoint.position, at(time)) < 2e-3
    assert max(off) < 0.02


def test_a_lonely_point_is_reached_at_rest() -> None:
    flight = Flight()
    assert flight.take(2.0, (0.5, 0.0, 1.0)) is None
    setpoint = flight.fly(2.0)
    assert setpoint.position == pytest.approx((0.5, 0.0, 1.0), abs=1e-4)
    assert setpoint.velocity == pytest.approx(ZERO, abs=1e-3)


def test_a_point_is_written_as_it_is_left_out() -> None:
    for more in ((), ((0.1, 0.0, 0.0),)):
        order = TrackOrder("mk", PlannedPoint(1.5, (0.1, 0.2, 1.0), *more))
        assert parse(text(order)) == order
