"""The driver for real drones on emulated ones, in memory: bad links, cut links, emergencies."""

from __future__ import annotations

from math import hypot

import pytest
from ardrone_flights import AgesOnReceipt, drone_flight, mission, succeeded
from toolchain import compiled

from kybflow.api.flight import RunRequest
from kybflow.api.opening import pace_of
from kybflow.core.errors import DriverError
from kybflow.core.signals import NS
from kybflow.drivers.ardrone.navdata import Phase
from kybflow.drivers.emulated_ardrone.drone import OnboardDrone

MORE = [pytest.param(rate, marks=pytest.mark.slow) for rate in (50, 100, 200)]
"""At the highest rate one drone flies in the thorough tests, for three for a minute take long."""
FAULT = "faults:\n  - {{at: {at}, on: a, inject: link_cut, for: {lasts}}}\n"


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [30, 200])
def test_a_bad_link_disconnects_nobody(rate, tmp_path, monkeypatch):
    ages = AgesOnReceipt(monkeypatch)
    *_, session = succeeded(mission(["a"], 10.0), tmp_path, **bad(rate))
    check_connection(session, ages)


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [30, *MORE])
def test_three_drones_for_a_minute_on_bad_links(rate, tmp_path, monkeypatch):
    ages = AgesOnReceipt(monkeypatch)
    text = mission(["a", "b", "c"], 60.0)
    flight, _, session = succeeded(text, tmp_path, **bad(rate))
    check_connection(session, ages)
    for record in flight.summary["vehicles"].values():
        assert record["position_error_m"]["mean"] < 0.1


def bad(rate):
    return {"rate": rate, "wifi_latency": 0.02, "wifi_jitter": 0.02, "wifi_loss": 0.05}


def check_connection(session, ages):
    for link in session.links.values():
        assert not link.drone.times_lost
        assert not link.wire.stream.hovered
        assert not link.wire.stream.ended
    assert len(ages.seconds) > 100
    assert max(ages.seconds) <= 0.1


@pytest.mark.thorough
@pytest.mark.parametrize("late", [0.3, pytest.param(0.5, marks=pytest.mark.slow), 1.0])
def test_commands_that_arrive_late_land_it(late, tmp_path):
    fault = f"faults:\n  - {{at: 12 s, on: a, inject: clock_late, by: {late} s, for: 60 s}}\n"
    watch = []
    _, told, _ = drone_flight(mission(["a"], 15.0) + fault, tmp_path, watch=watch)
    slow = [event.time / NS - 12.0 for event in told if event.name == "link_slow"]
    assert slow[0] < late + 0.6
    assert "landed" in [event.name for event in told]
    off = [hypot(true.position[0] + 1.5, true.position[1] - 0.5) for _, true in watch]
    assert max(off) < 0.5 + 0.5 + late


@pytest.mark.thorough
@pytest.mark.parametrize("way", ["both", "to_vehicle"])
def test_wifi_that_is_lost_for_a_second_is_not_called_slow(way, tmp_path):
    fault = f"faults:\n  - {{at: 12 s, on: a, inject: link_cut, way: {way}, for: 1 s}}\n"
    _, told, _ = succeeded(mission(["a"], 15.0) + fault, tmp_path)
    assert "link_slow" not in [event.name for event in told]


@pytest.mark.thorough
def test_wifi_that_is_lost_for_a_second_makes_it_hover_and_it_flies_on(tmp_path, monkeypatch):
    still = []
    mind = OnboardDrone._check_watchdogs

    def noting(drone, now):
        mind(drone, now)
        if drone.flight.phase is Phase.FLYING and drone.flight.moves is None:
            still.append(now / NS)

    monkeypatch.setattr(OnboardDrone, "_check_watchdogs", noting)
    text = mission(["a"], 15.0) + FAULT.format(at="12 s", lasts="1 s")
    _, told, session = succeeded(text, tmp_path)
    assert not session.links["a"].drone.times_lost
    assert "link_lost" not in [event.name for event in told]
    assert any(12.0 < seconds < 13.0 for seconds in still)
    ways = [e.fields["behavior"] for e in told if e.name == "behavior_started"]
    assert ways == ["up", "turn", "down", "landed"]


@pytest.mark.thorough
def test_a_drone_that_lost_everybody_on_the_ground_is_connected_again(tmp_path):
    breaks = [(0.3, {"deaf": True, "silent": True}), (3.3, {"deaf": False, "silent": False})]
    *_, session = succeeded(mission(["a"], 3.0), tmp_path, breaks=breaks)
    assert session.links["a"].drone.times_lost == 1


@pytest.mark.thorough
def test_wifi_that_is_lost_for_good_lands_that_drone_and_the_other_finishes(tmp_path):
    text = mission(["a", "b"], 15.0) + FAULT.format(at="12 s", lasts="100 s")
    _, told, session = drone_flight(text, tmp_path)
    a, b = session.links["a"], session.links["b"]
    assert a.drone.times_lost == 1
    assert not b.drone.times_lost
    assert a.truth().position[2] < 0.05
    assert not a.drone.flight.flies
    assert [e.name for e in told if e.vehicle == "a" and e.name == "link_lost"] == ["link_lost"]
    ways = [e.fields["behavior"] for e in told if e.vehicle == "b" and e.name == "behavior_started"]
    assert ways == ["up", "turn", "down", "landed"]


@pytest.mark.thorough
def test_the_same_seed_flies_the_same_flight(tmp_path):
    logs = []
    for name in ("one", "other"):
        request = RunRequest(seed=3, out=tmp_path / name)
        drone_flight(mission(["a"], 3.0), tmp_path, request=request)
        logs.append((tmp_path / name / "log.mcap").read_bytes())
    assert logs[0] == logs[1]


def test_over_sockets_it_keeps_real_time_and_refuses_another_pace(tmp_path):
    text, needs = mission(["a"], 3.0), "driver: {use: emulated_ardrone, network: true}"
    text += f"targets: {{there: {{all: {{{needs}}}}}}}\n"
    plan = compiled(tmp_path / "drones.yaml", text, target="there", warns=True)
    assert pace_of(plan, None) == pace_of(plan, 1.0) == 1.0
    with pytest.raises(DriverError, match="fly with `--speed 1` or without `--speed`"):
        pace_of(plan, 4.0)


@pytest.mark.thorough
def test_it_flies_on_the_fusion_of_its_imu_and_motion_capture(tmp_path):
    fused = "estimators: [{use: fusion, healthy: spread < 5 cm}]\n    behaviors:"
    text = mission(["a"], 6.0).replace("behaviors:", fused, 1)
    flight, told, _ = succeeded(text, tmp_path, **bad(50))
    assert not {"part_failed", "position_refused"} & {event.name for event in told}
    assert flight.summary["vehicles"]["a"]["position_error_m"]["mean"] < 0.1
