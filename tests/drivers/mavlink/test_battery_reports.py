"""What an autopilot says of its battery: its state, its health, its words."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from pymavlink.dialects.v20 import all as mavlink
from scripted_autopilot import BOTH, Bench, flying

from kybflow.core.signals import Battery, BatteryWarning

BATTERY = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY


def warning(bench: Bench) -> BatteryWarning | None:
    """What the newest report of the battery says, half a second later."""
    bench.run(0.5)
    reports = [m for m in bench.measured if isinstance(m, Battery)]
    return reports[-1].warning


def charge(state: int) -> mavlink.MAVLink_battery_status_message:
    cells = [3300] * 3 + [65535] * 7
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 0, cells, -1, -1, -1, 80, 0, state)


@pytest.mark.parametrize(
    ("name", "text", "acts"),
    [
        ("ardupilot", "Battery 1 is low 9.90V used 20 mAh", True),
        ("ardupilot", "Battery Failsafe", True),
        ("px4", "Low battery level", False),
        ("px4", "Critical battery level", True),
        ("px4", "Dangerously low battery! Shutting system down", True),
    ],
)
def test_its_words_count_until_it_is_disarmed(name, text, acts):
    bench = flying(name)
    assert warning(bench) is None
    bench.fake.say(text, 4)
    assert warning(bench) == BatteryWarning(f"it says '{text}'", acts)
    bench.fake.say("Low memory", 4)
    assert warning(bench) == BatteryWarning(f"it says '{text}'", acts)
    bench.fake.armed = False
    assert warning(bench) is None


def test_words_before_it_is_armed_are_the_preflights():
    bench = Bench("ardupilot")
    bench.fake.say("PreArm: Battery 1 low voltage failsafe")
    bench.fly()
    assert warning(bench) is None


def test_the_worst_words_stay():
    bench = flying("px4")
    bench.fake.say("Critical battery level", 2)
    bench.fake.say("Low battery level", 4)
    assert warning(bench) == BatteryWarning("it says 'Critical battery level'", True)


@pytest.mark.parametrize(
    ("name", "state", "said", "acts"),
    [
        ("ardupilot", 2, "low", True),
        ("px4", 2, "low", False),
        ("px4", 3, "critical", True),
        ("px4", 4, "nearly empty", True),
        ("px4", 6, "not well", False),
    ],
)
def test_its_state_of_charge_counts_while_it_lasts(name, state, said, acts):
    bench = flying(name)
    bench.fake.send(charge(state))
    assert warning(bench) == BatteryWarning(f"it reports its battery as {said}", acts)
    bench.fake.send(charge(1))
    assert warning(bench) is None


@BOTH
def test_a_battery_that_it_reports_as_not_well_is_a_warning(name):
    bench = flying(name)
    bench.fake.ill = BATTERY
    assert warning(bench) == BatteryWarning("it reports its battery as not well", False)
    bench.fake.ill = 0
    assert warning(bench) is None


@BOTH
def test_a_warning_counts_though_the_charge_is_not_known_any_more(name):
    bench = flying(name)
    bench.run(0.5)
    unknown = charge(3)
    unknown.battery_remaining = -1
    bench.fake.send(unknown)
    assert warning(bench) == BatteryWarning("it reports its battery as critical", True)
