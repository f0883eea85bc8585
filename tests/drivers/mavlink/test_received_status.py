"""What is remembered of what an autopilot says, and which of its sensors are not well."""

from __future__ import annotations

import pytest

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.telemetry.received_status import (
    ARMED,
    CHUNK_TIMEOUT,
    READY,
    SENSORS,
    WAYS_OUT,
    InnovationRatios,
    LandedState,
    ReceivedStatus,
    ReceivedText,
    SensorHealth,
)

mavlink = pytest.importorskip("pymavlink.dialects.v20.all")

LONG = "Preflight Fail: the vehicle is not level and the compass is far from where it was"


def text(words: str, severity: int = 2, number: int = 0, chunk: int = 0):
    return mavlink.MAVLink_statustext_message(severity, words.encode(), number, chunk)


def heartbeat(mode: int, armed: bool = False, autopilot: int = 3):
    base = ARMED if armed else 0
    return mavlink.MAVLink_heartbeat_message(2, autopilot, base, mode, 3, 3)


def texts(heard: ReceivedStatus) -> list[str]:
    return [said.text for said in heard.texts]


def test_before_anything_was_heard_nothing_is_known() -> None:
    heard = ReceivedStatus()
    assert (heard.heartbeat, heard.mode, heard.armed, heard.ready) == (None, None, False, None)
    assert (heard.landed, heard.words(0)) == (LandedState.UNKNOWN, "")


def test_a_heartbeat_tells_mode_and_arming() -> None:
    heard = ReceivedStatus()
    heard.handle(heartbeat(4, armed=True), 7)
    assert (heard.heartbeat, heard.mode, heard.armed, heard.status) == (7, 4, True, 3)
    heard.handle(mavlink.MAVLink_current_mode_message(0, 9, 9), 8)
    assert (heard.heartbeat, heard.mode) == (7, 9)


def test_the_heartbeat_of_a_camera_of_the_same_system_does_not_count() -> None:
    heard = ReceivedStatus()
    heard.handle(heartbeat(4, armed=True), 1)
    heard.handle(heartbeat(0, autopilot=8), 2)
    assert (heard.heartbeat, heard.mode, heard.armed) == (1, 4, True)


@pytest.mark.parametrize("position", [0.4, 1.2])
def test_innovations_are_read_from_either_firmware(position: float) -> None:
    nan = float("nan")
    found = InnovationRatios(position=position, height=0.2, velocity=0.1, heading=0.0)
    reports = (
        mavlink.MAVLink_estimator_status_message(5, 831, 0.1, position, 0.2, nan, 0, 0, 0.1, 0.1),
        mavlink.MAVLink_ekf_status_report_message(831, 0.1, position, 0.2, 0.0, 0.0),
    )
    for report in reports:
        heard = ReceivedStatus()
        heard.handle(report, 7)
        heard.handle(report, 9)
        assert heard.innovations == found
        assert heard.rejected_for == (2 if position > 1.0 else 0)
        assert heard.ekf == 831


def test_one_rejected_measurement_counts_no_time_until_the_next_report() -> None:
    heard = ReceivedStatus()
    found = []
    for second, position in enumerate((1.2, 0.4, 1.2, 1.2)):
        report = mavlink.MAVLink_ekf_status_report_message(831, 0.1, position, 0.2, 0.0, 0.0)
        heard.handle(report, second * NS)
        found.append(heard.rejected_for)
    assert found == [0, 0, 0, NS]


def test_readiness_and_ill_sensors() -> None:
    heard = ReceivedStatus()
    status = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    heard.handle(mavlink.MAVLink_sys_status_message(7 | READY, 5, 1, *status), 0)
    assert heard.ready is False
    assert heard.sensors is not None
    assert heard.sensors.unhealthy == 4
    heard.handle(mavlink.MAVLink_sys_status_message(0, 0, READY, *status), 1)
    assert heard.ready is True


def test_flags_outputs_throttle_and_ground() -> None:
    heard = ReceivedStatus()
    heard.handle(mavlink.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0), 0)
    heard.handle(mavlink.MAVLink_servo_output_raw_message(0, 0, *range(1000, 1008)), 0)
    heard.handle(mavlink.MAVLink_servo_output_raw_message(0, 1, *range(8)), 0)
    heard.handle(mavlink.MAVLink_attitude_target_message(0, 0, [1, 0, 0, 0], 0, 0, 0, 0.5), 0)
    heard.handle(mavlink.MAVLink_extended_sys_state_message(0, 3), 5)
    assert (heard.ekf, heard.servos[:2], heard.throttle) == (831, (1000, 1001), 0.5)
    assert (heard.landed, heard.at["EXTENDED_SYS_STATE"]) == (LandedState.TAKING_OFF, 5)


def test_what_no_autopilot_should_say_is_unknown() -> None:
    heard = ReceivedStatus()
    heard.handle(mavlink.MAVLink_extended_sys_state_message(0, 77), 0)
    nan = float("nan")
    heard.handle(mavlink.MAVLink_attitude_target_message(0, 0, [1, 0, 0, 0], 0, 0, 0, nan), 0)
    assert (heard.landed, heard.throttle) == (LandedState.UNKNOWN, None)


def test_a_text_loses_its_tab_and_what_a_terminal_would_obey() -> None:
    heard = ReceivedStatus()
    heard.handle(text("Arming denied:\x1b[2J no GPS\t"), 3)
    assert list(heard.texts) == [ReceivedText(3, 2, "Arming denied: [2J no GPS")]


def test_a_long_text_is_joined_in_whatever_order_it_comes() -> None:
    heard = ReceivedStatus()
    heard.handle(text(LONG[50:], number=9, chunk=1), 1)
    heard.handle(text("between", number=10), 2)
    assert texts(heard) == ["between"]
    heard.handle(text(LONG[:50], number=9), 3)
    assert texts(heard) == ["between", LONG]


@pytest.mark.parametrize(
    ("lost", "rest"), [(0, f"…{LONG[50:]}"), (1, f"{LONG[:50]}…")], ids=["first", "last"]
)
def test_a_lost_chunk_does_not_hold_the_rest_for_ever(lost: int, rest: str) -> None:
    heard = ReceivedStatus()
    for chunk in {0, 1} - {lost}:
        heard.handle(text(LONG[50 * chunk :][:50], number=9, chunk=chunk), 0)
    heard.handle(heartbeat(0), CHUNK_TIMEOUT)
    assert texts(heard) == []
    heard.handle(heartbeat(0), CHUNK_TIMEOUT + 1)
    assert list(heard.texts) == [ReceivedText(0, 2, rest)]


def test_many_unfinished_texts_do_not_pile_up() -> None:
    heard = ReceivedStatus()
    for number in range(1, 1000):
        heard.handle(text(LONG[:50], number=number), 0)
    assert len(heard.texts) == 100


def test_words_are_the_warnings_since_then_each_once_newest_last() -> None:
    heard = ReceivedStatus()
    said = [("Arm: old", 2), ("Arm: level", 2), ("EKF3 is using GPS", 6), ("Bad compass", 4)]
    for second, (words, severity) in enumerate([*said, ("Arm: level", 2)]):
        heard.handle(text(words, severity), second * NS)
    assert heard.words(NS) == "Bad compass; Arm: level"
    assert heard.words(5 * NS) == ""


GYROSCOPE, COMPASS = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
BATTERY, MORE = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY, mavlink.MAV_SYS_STATUS_EXTENSION_USED
ALL = 0xFFFF_FFFF


def test_every_sensor_of_the_dialect_has_a_plain_name() -> None:
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
