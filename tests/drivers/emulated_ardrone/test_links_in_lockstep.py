"""The driver for real drones on emulated ones, in memory: bad links, cut links, emergencies."""

from __future__ import annotations

import pytest
from ardrone_flights import AgesOnReceipt, flown, mission

from kybflow.api.flight import RunRequest

FAULT = "faults:\n  - {{at: {at}, on: a, inject: link_cut, for: {lasts}}}\n"


@pytest.mark.parametrize("rate", [30, 200])
def test_a_bad_link_disconnects_nobody(rate, tmp_path, monkeypatch):
    ages = AgesOnReceipt(monkeypatch)
    flight, told, session = flown(mission(["a"], 10.0), tmp_path, ages=ages, **bad(rate))
    assert flight.summary["outcome"] == "succeeded", told
    check_connection(session, ages)


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [30, 50, 100, 200])
def test_three_drones_for_a_minute_on_bad_links(rate, tmp_path, monkeypatch):
    ages = AgesOnReceipt(monkeypatch)
    text = mission(["a", "b", "c"], 60.0)
    flight, told, session = flown(text, tmp_path, ages=ages, **bad(rate))
    assert flight.summary["outcome"] == "succeeded", told
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


def test_wifi_that_is_lost_for_a_second_is_flown_on_where_the_mission_allows_that(tmp_path):
    patient = "supervisors: [{use: link, age: 1.5 s}]\n    behaviors:"
    text = mission(["a"], 15.0).replace("behaviors:", patient, 1)
    flight, told, session = flown(text + FAULT.format(at="12 s", lasts="1 s"), tmp_path)
    assert flight.summary["outcome"] == "succeeded", told
    assert not session.links["a"].drone.times_lost
    assert flight.summary["vehicles"]["a"]["final"] == "ground"


def test_a_drone_that_lost_everybody_on_the_ground_is_connected_again(tmp_path):
    breaks = [(0.3, {"deaf": True, "silent": True}), (3.3, {"deaf": False, "silent": False})]
    flight, told, session = flown(mission(["a"], 3.0), tmp_path, breaks=breaks)
    assert session.links["a"].drone.times_lost == 1
    assert flight.summary["outcome"] == "succeeded", told


def test_wifi_that_is_lost_for_good_lands_that_drone_and_the_other_finishes(tmp_path):
    text = mission(["a", "b"], 15.0) + FAULT.format(at="12 s", lasts="100 s")
    _, told, session = flown(text, tmp_path)
    a, b = session.links["a"], session.links["b"]
    assert a.drone.times_lost == 1
    assert not b.drone.times_lost
    assert a.truth().position[2] < 0.05
    assert not a.drone.flight.flies
    assert [e.name for e in told if e.vehicle == "a" and e.name == "link_lost"] == ["link_lost"]
    ways = [e.fields["behavior"] for e in told if e.vehicle == "b" and e.name == "behavior_started"]
    assert ways == ["up", "turn", "down", "landed"]


def test_the_same_seed_flies_the_same_flight(tmp_path):
    logs = []
    for name in ("one", "other"):
        request = RunRequest(seed=3, out=tmp_path / name)
        flown(mission(["a"], 3.0), tmp_path, request=request)
        logs.append((tmp_path / name / "log.mcap").read_bytes())
    assert logs[0] == logs[1]
