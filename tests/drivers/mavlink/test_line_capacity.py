"""A serial line is asked for no more than it carries, and what is sent must get through."""

from __future__ import annotations

import pytest
from framing import INTERVAL
from scripted_autopilot import Bench

from kybflow.core.signals import Imu, Odometry
from kybflow.drivers.mavlink import MavlinkParams
from kybflow.drivers.mavlink.autopilot_state import LineCapacity
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.protocol.framing import NUMBERS

SLOW, QUICK = "serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:921600"
SIZES = {"ATTITUDE_QUATERNION": 60, "HEARTBEAT": 21}
"""Bytes of their frames, unsigned: 48 and 9 of fields (MAVLink's common dialect)."""


def capacity(address: str | None, **params) -> LineCapacity:
    return LineCapacity(MavlinkParams(autopilot="ardupilot", address=address, **params))


def taken(rates: dict[str, float]) -> float:
    return sum(rate * SIZES[name] for name, rate in rates.items())


@pytest.mark.parametrize("address", [None, "udpin:127.0.0.1:14540", "tcp:10.0.0.1:5760", QUICK])
def test_whatever_is_quick_enough_is_asked_for_all(address):
    streams = dict.fromkeys(profile_of("ardupilot").streams, 50.0)
    assert capacity(address).fitting(streams) == streams


def test_streams_take_half_of_a_slow_line_all_rarer_by_the_same_factor():
    asked = {"ATTITUDE_QUATERNION": 100.0, "HEARTBEAT": 10.0}
    fitting = capacity(SLOW).fitting(asked)
    assert taken(fitting) == pytest.approx(2880.0)
    assert fitting["ATTITUDE_QUATERNION"] / fitting["HEARTBEAT"] == pytest.approx(10.0)


def test_nothing_is_rarer_than_once_a_second_and_what_was_rarer_stays_so():
    asked = {"ATTITUDE_QUATERNION": 200.0, "HEARTBEAT": 2.0, "BATTERY_STATUS": 0.2}
    fitting = capacity(SLOW).fitting(asked)
    assert (fitting["HEARTBEAT"], fitting["BATTERY_STATUS"]) == (1.0, 0.2)


def test_a_signature_counts():
    asked = {"HEARTBEAT": 1000.0}
    fitting = capacity(SLOW, key="a file").fitting(asked)
    assert fitting["HEARTBEAT"] * (SIZES["HEARTBEAT"] + 13) == pytest.approx(2880.0)


@pytest.mark.parametrize(
    ("params", "load", "way_out"),
    [
        ({"position": "own"}, 3250, ""),
        ({"position": "own", "rate": 100.0}, 6500, "set a lower `rate`, or a higher baud rate"),
        (
            {},
            10600,
            "set a lower `rate` and `vision_rate`, or a higher baud rate on both sides",
        ),
        ({"rate": 10.0, "vision_rate": 10.0}, 3100, ""),
    ],
)
def test_the_preflight_says_what_is_sent_and_what_gets_through(params, load, way_out):
    (line,) = capacity(SLOW, **params).check()
    assert f"{load} bytes a second are sent to it, the line carries 5760" in line.reason
    assert (line.green, line.waits) == (not way_out, not way_out)
    assert way_out in line.reason


def test_other_wires_have_no_such_line():
    assert capacity("udpin:14540").check() == []


def test_a_vehicle_on_a_radio_is_asked_for_what_fits_also_once_its_imu_is_flown_by():
    bench = Bench("ardupilot", address=SLOW)
    bench.run(2.0)
    assert bench.link.checks(bench.now)[-1].name == "serial line"
    assert asked(bench) == pytest.approx(12.7, abs=0.1)
    bench.fake.sent.clear()
    bench.link.subscribe(frozenset({Imu}))
    bench.run(0.5)
    assert asked(bench) == pytest.approx(8.25, abs=0.1)
    bench.link.subscribe(frozenset({Imu, Odometry}))
    bench.run(0.5)
    assert asked(bench) == pytest.approx(12.8, abs=0.1)


def asked(bench: Bench) -> float:
    """Hz of ATTITUDE_QUATERNION, as it was asked for last."""
    return (
        1e6
        / [
            m.param2
            for m in bench.fake.commands(INTERVAL)
            if m.param1 == NUMBERS["ATTITUDE_QUATERNION"]
        ][-1]
    )
