"""Which of its sensors an autopilot reports as not well, in plain words."""

from __future__ import annotations

import pytest

from kybflow.drivers.mavlink.preflight.ailments import NAMES, WAYS_OUT, Sensors

GYROSCOPE, COMPASS, BATTERY, READY, MORE = 1, 4, 1 << 25, 1 << 28, 1 << 31
ALL = 0xFFFF_FFFF


def test_every_sensor_of_the_dialect_has_a_plain_name() -> None:
    mavlink = pytest.importorskip("pymavlink.dialects.v20.all")
    bits = {bit for bit in mavlink.enums["MAV_SYS_STATUS_SENSOR"] if bit.bit_count() == 1}
    assert set(NAMES) == bits - {READY, MORE}
    assert set(WAYS_OUT) < set(NAMES)
    assert len(set(NAMES.values())) == len(NAMES)


def test_only_what_is_there_in_use_and_not_well_is_named() -> None:
    assert Sensors(ALL, ALL, ALL & ~COMPASS & ~GYROSCOPE).words == "gyroscope, compass"
    assert Sensors(ALL & ~COMPASS, ALL, ALL & ~COMPASS).words == ""
    assert Sensors(ALL, ALL & ~COMPASS, ALL & ~COMPASS).words == ""


def test_what_to_look_at_is_said_where_it_is_known() -> None:
    said = Sensors(ALL, ALL, ALL & ~BATTERY).words
    assert said == "battery (is it charged, and its monitor set up?)"


def test_that_it_is_not_ready_is_no_sensor() -> None:
    assert Sensors(ALL, ALL, ALL & ~READY).words == ""
