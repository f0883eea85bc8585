"""Which of its sensors an autopilot reports as not well, in plain words."""

from __future__ import annotations

import pytest

from kybflow.drivers.mavlink.telemetry.received_status import (
    READY,
    SENSORS,
    WAYS_OUT,
    SensorHealth,
)

mavlink = pytest.importorskip("pymavlink.dialects.v20.all")

GYROSCOPE, COMPASS = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
BATTERY, MORE = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY, mavlink.MAV_SYS_STATUS_EXTENSION_USED
ALL = 0xFFFF_FFFF


def test_every_sensor_of_the_dialect_has_a_plain_name() -> None:
    mavlink = pytest.importorskip("pymavlink.dialects.v20.all")
    bits = {bit for bit in mavlink.enums["MAV_SYS_STATUS_SENSOR"] if bit.bit_count() == 1}
    assert set(SENSORS) == bits - {READY, MORE}
    assert set(WAYS_OUT) < set(SENSORS)
    assert len(set(SENSORS.values())) == len(SENSORS)


def test_only_what_is_there_in_use_and_not_well_is_named() -> None:
    assert SensorHealth(ALL, ALL, ALL & ~COMPASS & ~GYROSCOPE).words == "gyroscope, compass"
    assert SensorHealth(ALL & ~COMPASS, ALL, ALL & ~COMPASS).words == ""
    assert SensorHealth(ALL, ALL & ~COMPASS, ALL & ~COMPASS).words == ""


def test_what_to_look_at_is_said_where_it_is_known() -> None:
    said = SensorHealth(ALL, ALL, ALL & ~BATTERY).words
    assert said == "battery (is it charged, and its monitor set up?)"


def test_that_it_is_not_ready_is_no_sensor() -> None:
    assert SensorHealth(ALL, ALL, ALL & ~READY).words == ""
