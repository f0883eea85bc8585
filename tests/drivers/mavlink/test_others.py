"""Who else commands an autopilot, as far as it shows."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from framing import INTERVAL, REQUEST, SET_MODE
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.control.others import FINDING_REPEAT_NS, OtherCommanders

POSITION, ACCELERATION = 0xDF8, 0xC3F
"""Masks that leave only the position, only the acceleration."""
PX4 = 0
"""The mask of PX4, whose unused fields are NaN."""


def sent(mask: int, *values: float) -> Any:
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, mask, *values, 0.0, 0.0
    )


def followed(mask: int, *values: float) -> Any:
    return mavlink.MAVLink_position_target_local_ned_message(0, 1, mask, *values, 0.0, 0.0)


def of(system: int, message: Any) -> Any:
    message.get_header().srcSystem = system
    return message


def heartbeat(system: int) -> Any:
    return of(system, mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))


@pytest.fixture
def others() -> OtherCommanders:
    return OtherCommanders(1, 245)


HERE = (0.1, 0.2, -1.0)
STILL = (0.0, 0.0, 0.0)


def test_a_target_that_we_sent_is_nobody_elses(others: OtherCommanders) -> None:
    for step in range(50):
        now = step * NS // 10
        others.sent(sent(POSITION, *HERE, *STILL, *STILL), now)
        others.follows(followed(POSITION, *HERE, *STILL, *STILL), now)
        others.follows(followed(PX4, *HERE, 0.4, 0.0, 0.0, 1.0, 0.0, 0.0), now)
    assert others.take() == []


def test_a_program_with_our_own_system_id_is_told(others: OtherCommanders) -> None:
    for second in range(3):
        others.overheard(heartbeat(245), second * NS)
    assert others.take() == [
        "another program has our system id 245 too: give one of them another `own_system`"
    ]


def test_two_foreign_targets_in_three_seconds_are_told_once_and_by_whom(
    others: OtherCommanders,
) -> None:
    others.overheard(heartbeat(200), 0)
    told = []
    for step in range(50):
        now = step * NS // 5
        others.sent(sent(ACCELERATION, *STILL, *STILL, 0.1, 0.0, 0.0), now)
        mine, theirs = (ACCELERATION, *STILL, *STILL, 0.1, 0.0, 0.0), (POSITION, 2.0, 0.0, -1.0)
        others.follows(followed(*(mine if step % 2 else (*theirs, *STILL, *STILL))), now)
        told.append(others.take())
    assert [step for step, words in enumerate(told) if words] == [2]
    assert told[2] == [
        "it follows setpoints that this program did not send: position (2.0, 0.0, -1.0) north,"
        " east, down; ground station 200 is also connected"
    ]


def test_what_px4_does_by_itself_on_the_ground_is_nobody_elses(others: OtherCommanders) -> None:
    nothing = (float("nan"),) * 3
    for step in range(10):
        others.sent(sent(ACCELERATION, *STILL, *STILL, 0.1, 0.0, 1.0), step * NS // 5)
        others.follows(followed(PX4, *nothing, *nothing, 0.0, 0.0, 100.0), step * NS // 5)
    assert others.take() == []


def test_a_single_odd_target_is_not_told(others: OtherCommanders) -> None:
    for step in range(0, 60, 10):
        others.follows(followed(POSITION, 2.0, 0.0, -1.0, *STILL, *STILL), step * NS)
    assert others.take() == []


def test_a_setpoint_is_ours_for_a_second_after_the_next_however_long_it_was_the_last(
    others: OtherCommanders,
) -> None:
    """While this process hangs, the autopilot follows the last one, and its reports wait here."""
    others.sent(sent(POSITION, *HERE, *STILL, *STILL), 0)
    others.sent(sent(POSITION, 3.0, 0.0, -1.0, *STILL, *STILL), 2 * NS)
    for late, found in (0.4, 0), (1.1, 1):
        for step in range(3):
            now = 2 * NS + round(late * NS) + step * NS // 5
            others.follows(followed(POSITION, *HERE, *STILL, *STILL), now)
        assert len(others.take()) == found


def test_its_rest_once_set_points_have_stopped_is_nobody_elses(others: OtherCommanders) -> None:
    """As Copter rests after GUID_TIMEOUT, and as its buffered words come after a hang of ours."""
    others.sent(sent(ACCELERATION, *STILL, *STILL, 1.5, 0.0, 0.0), 0)
    for step in range(8):
        others.follows(followed(ACCELERATION, *STILL, *STILL, *STILL), step * NS // 4)
    assert others.take() == []


def test_the_target_of_its_own_take_off_is_nobody_elses_until_we_send(
    others: OtherCommanders,
) -> None:
    """As Copter's, in the air, while this process hangs before its first setpoint."""
    others.sent(sent(ACCELERATION, *STILL, *STILL, 0.0, 0.0, -1.0), 0)
    others.follow_nobody()
    for step in range(8):
        others.follows(followed(POSITION, *STILL, *STILL, *STILL), step * NS // 4)
    assert others.take() == []
    for step in range(8, 12):
        others.sent(sent(ACCELERATION, *STILL, *STILL, 0.0, 0.0, -1.0), step * NS // 4)
        others.follows(followed(POSITION, *STILL, *STILL, *STILL), step * NS // 4)
    assert len(others.take()) == 1


def test_our_last_set_point_is_ours_however_late_it_is_heard(others: OtherCommanders) -> None:
    others.sent(sent(ACCELERATION, *STILL, *STILL, 1.5, 0.0, 0.0), 0)
    for _ in range(4):
        others.follows(followed(ACCELERATION, *STILL, *STILL, 1.5, 0.0, 0.0), 2 * NS)
    assert others.take() == []


def test_a_target_without_a_field_tells_nothing(others: OtherCommanders) -> None:
    nan = float("nan")
    for step in range(9):
        others.follows(followed(PX4, *[nan] * 9), step * NS // 5)
        others.follows(followed(0xFFF, *[0.0] * 9), step * NS // 5)
    assert others.take() == []


def ack(command: int, to: int) -> Any:
    return mavlink.MAVLink_command_ack_message(command, 0, 255, 0, to, 190)


@pytest.mark.parametrize(
    ("command", "to", "told"),
    [
        (SET_MODE, 200, ["system 200 commands it: DO_SET_MODE"]),
        (SET_MODE, 245, []),
        (SET_MODE, 0, []),
        (INTERVAL, 200, []),
    ],
)
def test_an_answer_to_somebody_else_names_him(
    others: OtherCommanders, command: int, to: int, told: list[str]
) -> None:
    others.answered(ack(command, to), 0)
    assert others.take() == told


def test_what_is_overheard_names_the_sender_once_in_ten_seconds(others: OtherCommanders) -> None:
    for now in (0, NS, FINDING_REPEAT_NS):
        others.overheard(of(200, sent(POSITION, *HERE, *STILL, *STILL)), now)
    words = "system 200 commands it: SET_POSITION_TARGET_LOCAL_NED"
    assert others.take() == [words, words]


@pytest.mark.parametrize(
    "message",
    [
        mavlink.MAVLink_command_long_message(1, 1, REQUEST, 0, *[0.0] * 7),
        mavlink.MAVLink_command_long_message(2, 1, SET_MODE, 0, *[0.0] * 7),
        mavlink.MAVLink_system_time_message(0, 0),
    ],
)
def test_what_does_not_command_this_vehicle_is_ignored(
    others: OtherCommanders, message: Any
) -> None:
    others.overheard(of(200, message), 0)
    assert others.take() == []


def test_a_parameter_that_changes_is_told_with_both_values(others: OtherCommanders) -> None:
    others.changed("GUID_TIMEOUT", 0.5, 30.0, 0)
    assert others.take() == ["somebody set GUID_TIMEOUT from 0.5 to 30"]
