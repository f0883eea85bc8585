"""What a vehicle with a will of its own is told and asked, where the obvious answer would hurt."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from plans import part, vehicle, wrapped
from short_flights import down, hold, named, path, up
from test_override import BACK, PILOT, Autopilot, driver, flight

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NS, Estimate
from kybflow.runtime.vehicle.estimation import ExternalPosition
from kybflow.runtime.vehicle.requests import Requester


def ask_later(asks, seconds):
    def ask(engine):
        if engine.seconds() > seconds and not asks:
            asks.append(engine.seconds())
            engine.vehicles[0].requests.switch("up", Requester.FLOW)

    return ask


def test_nobody_takes_off_again_with_what_a_pilot_put_down(run):
    own, opened = driver("pilot lands")
    asks = []
    other = vehicle("b", [up("hold"), hold(8.0, "down"), down()], start=(1.0, 0.0, 0.0))
    mine = flight(own, start=(-1.0, 0.0, 0.0))
    _flown, told = run(mine, other, observers=(ask_later(asks, BACK + 1.0),))
    after = [what for time, what in opened[0].calls if time > BACK + 0.1]
    assert "arm" not in after
    assert path(told, "a") == ["up", "hold", "landed"]
    [refused] = named(told, "switch_refused")
    assert refused.fields["reason"] == "somebody else has control, until `operator.resume`"


class Guest(Autopilot):
    """Somebody arms it once it has landed."""

    def read(self, now):
        measured = super().read(now)
        resting = self.calls and self.calls[-1][1] == "rest"
        if resting and now / NS - self.calls[-1][0] < 0.1:
            self.armed, self.override = True, PILOT
        return measured

    def send(self, command, now):
        if self.override is None:
            super().send(command, now)


def test_a_run_ends_though_somebody_armed_the_vehicle_after_it(run):
    own = wrapped(lambda _, link: Guest(link, "slow"))
    flown, told = run(flight(own, 1.0))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["sim_time_s"] < 30.0
    assert flown.exit_code == 0


class Believed:
    """The estimators of a vehicle: which one is in use, and which can be."""

    def __init__(self, *names: str) -> None:
        self.names, self.source, self.usable = names, names[0], set(names)

    @property
    def candidates(self) -> list[Any]:
        return [
            SimpleNamespace(name=name, is_usable=name in self.usable, estimate=estimate(name))
            for name in self.names
        ]


def estimate(source: str) -> Estimate:
    return Estimate(0, ZERO, ZERO, LEVEL, ZERO, source, 0.0, 0.01)


def telling(*parts: tuple[str, str]) -> tuple[ExternalPosition, Believed]:
    """Of estimators with these names in the mission, each of a part."""
    plans = [
        SimpleNamespace(part=replace(part("estimators", use), label=f"estimators.{name}"))
        for name, use in parts
    ]
    believed = Believed(*(name for name, _ in parts))
    return ExternalPosition(SimpleNamespace(estimators=plans), believed), believed  # type: ignore[arg-type]


def told(tells: ExternalPosition, believed: Believed, source: str | None) -> str | None:
    believed.source = source  # type: ignore[assignment]
    found = tells.of(None if source is None else estimate(source))
    return None if found is None else found.source


def test_its_own_estimate_is_not_told_to_it_under_another_name():
    tells, believed = telling(("on_board", "autopilot"))
    assert told(tells, believed, "on_board") is None


def test_one_that_flies_on_its_own_estimate_is_still_told_of_another():
    tells, believed = telling(("autopilot", "autopilot"), ("mocap", "mocap"))
    assert told(tells, believed, "autopilot") == "mocap"
    believed.usable.discard("mocap")
    assert told(tells, believed, "autopilot") is None


@pytest.mark.parametrize(("before", "is_told"), [("mocap", True), ("autopilot", False)])
def test_dead_reckoning_is_told_where_what_it_began_from_was_from_outside(before, is_told):
    tells, believed = telling(
        ("mocap", "mocap"), ("autopilot", "autopilot"), ("inertial", "inertial")
    )
    believed.usable.discard("mocap")
    assert told(tells, believed, before) == (before if is_told else None)
    assert told(tells, believed, "inertial") == ("inertial" if is_told else None)
    assert told(tells, believed, None) is None
    assert told(tells, believed, "inertial") == ("inertial" if is_told else None)
    believed.usable.add("mocap")
    assert told(tells, believed, "mocap") == "mocap"
    assert told(tells, believed, "inertial") == "inertial"
