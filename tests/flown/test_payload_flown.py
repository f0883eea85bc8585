"""A payload in flight: let go once, where the vehicle hovers, acknowledged or failed with the
reason; whatever becomes of it, the vehicle comes down."""

from __future__ import annotations

from pathlib import Path

import pytest
from plans import Through, after, failed, part, state, then, vehicle, wrapped
from short_flights import down, hold, named, path, up
from toolchain import compiled, flight_of

from kybflow.core.errors import DriverError, Refused
from kybflow.core.signals import NS, Payload
from kybflow.dsl.plan import TransitionPlan
from kybflow.parts import Link
from kybflow.world.vehicle_context import Parcel

PARCEL = Parcel(mass=0.046, size=0.06)
MISSION = """
kybflow: 1
mission: drop
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}, points: {mark: [0.6, 0, 0]}}
vehicles:
  a:
    like: std.courier_quad
    payload: {mass: 300 g, size: 12 cm, aboard: false}
    behaviors:
      load:  {do: load_payload, then: up}
      up:    {do: take_off, height: 1 m, speed: 60 cm/s, then: go}
      go:    {do: fly_to, position: [0.6, 0, 1], then: drop}
      drop:  {do: release_payload, then: again}
      again: {do: release_payload, then: down}
      down:  {do: land}
expect:
  - eventually a.payload == aboard within 100 ms
  - finally a.payload == released
  - finally a.payload.releases == 1
  - finally distance(a.payload to world.points.mark) < 15 cm
  - max(distance(a to a.payload) in go) < 2 cm
"""


class Awkward(Through):
    """The link of a simulated vehicle whose servo is awkward in some `way`: it is `deaf`,
    `refuses`, `breaks`, or is `slow` and acknowledges a second late. `asked` counts how often."""

    def __init__(self, link: Link, way: str) -> None:
        super().__init__(link)
        self.way, self.asked = way, 0
        self._late: list[tuple[int, Payload]] = []

    def read(self, now):
        measured = list(super().read(now))
        if self.way == "slow":
            self._late += [(now + NS, m) for m in measured if isinstance(m, Payload) and m.time]
            measured = [m for m in measured if not isinstance(m, Payload) or not m.time]
            measured += [m for due, m in self._late if due <= now]
            self._late = [(due, m) for due, m in self._late if due > now]
        return measured

    def grip(self, is_open, now):
        self.asked += 1
        if self.way == "refuses":
            raise Refused("COMMAND_DENIED: gripper 1 is not configured")
        if self.way == "breaks":
            raise DriverError("the cable is out")
        if self.way == "slow" and self.asked == 1:
            self.link.grip(is_open, now)


def driver(way: str):
    """(the driver, the links that it opened)"""
    opened: list[Awkward] = []

    def wrap(_, link):
        opened.append(Awkward(link, way))
        return opened[0]

    return wrapped(wrap), opened


def drop(name: str, *arrows: TransitionPlan):
    return state(name, part("behaviors", "release_payload", patience=2.0, settle=0.5), *arrows)


@pytest.mark.thorough
def test_a_mission_loads_delivers_once_and_is_judged(tmp_path: Path) -> None:
    plan = compiled(tmp_path / "m.yaml", MISSION)
    flown, told = flight_of(plan, tmp_path / "run")
    assert [(line["text"], line["held"]) for line in flown.summary["expectations"]] == [
        (text.text, True) for text in plan.expectations
    ]
    [released], [rested] = named(told, "payload_released"), named(told, "payload_rested")
    assert len(named(told, "payload_loaded")) == len(named(told, "payload_already_released")) == 1
    place = released.fields
    assert (place["x"], place["y"], place["z"]) == pytest.approx((0.6, 0.0, 1.0), abs=0.03)
    assert (rested.fields["x"], rested.fields["y"]) == pytest.approx((0.6, 0.0), abs=0.03)
    assert rested.fields["z"] == pytest.approx(0.01, abs=0.002)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("way", "reason"),
    [
        ("deaf", "the release was not acknowledged within 2 s"),
        ("refuses", "COMMAND_DENIED: gripper 1 is not configured"),
    ],
)
def test_a_release_that_does_not_come_about_fails_with_its_reason(run, way, reason) -> None:
    own, opened = driver(way)
    states = [up("drop"), drop("drop", failed("down")), down()]
    _, told = run(vehicle("a", states, driver=own, payload=PARCEL))
    assert path(told, "a") == ["up", "drop", "down", "landed"]
    assert [e.fields["reason"] for e in named(told, "behavior_failed")] == [reason]
    assert named(told, "payload_released") == []
    assert opened[0].asked > (100 if way == "deaf" else 0)


@pytest.mark.thorough
def test_a_link_that_breaks_at_the_release_lands_the_vehicle(run) -> None:
    own, _ = driver("breaks")
    states = [up("drop"), drop("drop", then("down")), down()]
    flown, told = run(vehicle("a", states, driver=own, payload=PARCEL))
    assert path(told, "a") == ["up", "drop", "auto_land", "fault"]
    assert flown.exit_code == 3


@pytest.mark.thorough
def test_interrupted_before_the_acknowledgement_it_is_released_once(run) -> None:
    own, opened = driver("slow")
    first, again = drop("drop", after(0.5, "hold"), then("down")), drop("again", then("down"))
    states = [up("drop"), first, hold(1.0, "again"), again, down()]
    flown, told = run(vehicle("a", states, driver=own, payload=PARCEL))
    assert path(told, "a") == ["up", "drop", "hold", "again", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    [released] = named(told, "payload_released")
    assert released.fields["took"] == pytest.approx(1.0, abs=0.1)
    assert len(named(told, "payload_already_released")) == 1
    assert opened[0].truth().payload[2] == pytest.approx(-0.02, abs=0.01)


def test_on_the_ground_it_is_let_go_without_a_flight(run) -> None:
    _, told = run(vehicle("a", [drop("drop", then("landed"))], payload=PARCEL))
    assert path(told, "a") == ["drop", "landed"]
    assert len(named(told, "payload_released")) == 1
