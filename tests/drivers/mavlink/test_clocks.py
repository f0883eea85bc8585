"""The clock of an autopilot: stamps in the run's time, reboots, round trips, answers."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.telemetry.clocks import MS, BootClock, TimeSync, boot_time

TICK: Time = 4 * MS
BOOTED: Time = -40 * NS
"""When the autopilot booted, in the run's time."""


def tick_after(time: Time) -> Time:
    return -(-time // TICK) * TICK


def known(clock: BootClock, begin: Time = 0, booted: Time = BOOTED) -> BootClock:
    """A clock that has heard a second of messages without a delay."""
    for now in range(begin, begin + NS, 10 * MS):
        clock.to_run(now - booted, now)
    return clock


def test_stamps_are_right_to_a_millisecond_however_ticks_and_delays_fall() -> None:
    generator, clock, errors = random.Random(5), BootClock(), []
    for number in range(1000):
        true = number * 9 * MS + generator.randrange(MS)
        now = tick_after(true + MS // 5 + generator.randrange(3 * MS))
        errors.append(clock.to_run(true - BOOTED, now) - true)
    assert max(errors[200:]) < MS
    assert min(errors) >= 0


def test_a_drift_of_100_ppm_is_followed() -> None:
    clock = BootClock()
    for number in range(6000):
        true = number * 10 * MS
        stamp = clock.to_run(round(true * 1.0001) - BOOTED, true)
    assert abs(stamp - true) < 2 * MS


@given(st.lists(st.tuples(st.integers(1, 30), st.integers(0, 400)), min_size=2, max_size=60))
def test_order_is_kept_and_nothing_is_from_the_future(steps: list[tuple[int, int]]) -> None:
    clock, true, now, last = BootClock(), 0, 0, -(10**18)
    for step, delay in steps:
        true += step * MS
        now = max(now, tick_after(true + delay * MS))
        stamp = clock.to_run(true - BOOTED, now)
        assert last <= stamp <= now
        last = stamp


def test_what_was_said_of_one_moment_has_one_time() -> None:
    clock = known(BootClock())
    boot = NS - BOOTED
    first = clock.to_run(boot, NS + 2 * MS)
    assert clock.to_run(boot, NS + 8 * MS) == first


def test_a_message_that_was_overtaken_keeps_its_place() -> None:
    clock = known(BootClock())
    later = clock.to_run(NS + 20 * MS - BOOTED, NS + 20 * MS)
    assert clock.to_run(NS + 10 * MS - BOOTED, NS + 24 * MS) == later - 10 * MS


def test_a_reboot_begins_anew() -> None:
    clock = known(BootClock())
    again = known(clock, 20 * NS, booted=15 * NS)
    assert again.reboots == 1
    assert again.to_run(10 * NS, 25 * NS + MS) == 25 * NS
    assert again.to_boot(26 * NS) == 11 * NS


def test_one_stamp_that_goes_back_is_no_reboot() -> None:
    clock = known(BootClock())
    assert clock.to_run(5 * NS, NS) == NS
    assert clock.to_run(NS - BOOTED, NS + MS) == NS
    assert clock.reboots == 0


def test_one_stamp_far_ahead_is_not_believed() -> None:
    clock = known(BootClock())
    assert clock.to_run(900 * NS, NS) == NS
    for number in range(1, 10):
        true = NS + number * 10 * MS
        assert clock.to_run(true - BOOTED, true) == true
    assert clock.reboots == 0


def test_a_time_of_the_run_in_the_time_of_the_autopilot() -> None:
    clock = BootClock()
    assert clock.to_boot(NS) is None
    assert known(clock).to_boot(NS) == NS - BOOTED
    late = known(BootClock(), 10 * NS, booted=5 * NS)
    assert late.to_boot(4 * NS) is None, "it had not booted"


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (mavlink.MAVLink_attitude_message(1234, 0, 0, 0, 0, 0, 0), 1_234_000_000),
        (mavlink.MAVLink_scaled_imu_message(0, *[0] * 9), None),
        (mavlink.MAVLink_highres_imu_message(1_234_567, *[0] * 14), 1_234_567_000),
        (mavlink.MAVLink_highres_imu_message(1_700_000_000_000_000, *[0] * 14), None),
        (mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3), None),
    ],
    ids=["milliseconds", "not filled in", "microseconds", "time of day", "no stamp"],
)
def test_the_stamp_of_a_message(message: object, expected: Time | None) -> None:
    assert boot_time(message) == expected


def answers(sync: TimeSync, clock: BootClock, until: Time, back: Time = 0) -> list[Time]:
    """An autopilot that answers at once, heard at the tick after; when it was asked."""
    asked: list[Time] = []
    for now in range(0, until, TICK):
        for request in sync.due(now):
            assert request.tc1 == 0
            asked.append(now)
            reply = mavlink.MAVLink_timesync_message(now + MS - BOOTED, request.ts1)
            sync.hear(reply, now + TICK + back)
    return asked


def test_it_asks_often_at_first_and_then_once_a_second() -> None:
    asked = answers(TimeSync(BootClock()), BootClock(), 6 * NS)
    assert len([time for time in asked if time < 2 * NS]) == 20
    assert [later - time for time, later in pairwise(asked[19:])] == [NS] * 4


def test_round_trip_and_offset_are_learned() -> None:
    sync = TimeSync(BootClock())
    assert (sync.round_trip, sync.offset) == (None, None)
    answers(sync, BootClock(), NS)
    assert (sync.round_trip, sync.offset) == (TICK, BOOTED + MS)


def test_a_slow_round_trip_teaches_nothing_until_all_are_slow() -> None:
    sync = TimeSync(BootClock())
    answers(sync, BootClock(), NS)
    (request,) = sync.due(2 * NS)
    sync.hear(mavlink.MAVLink_timesync_message(5, request.ts1), 2 * NS + 500 * MS)
    assert (sync.round_trip, sync.offset) == (TICK, BOOTED + MS)
    (request,) = sync.due(20 * NS)
    sync.hear(mavlink.MAVLink_timesync_message(NS, request.ts1), 20 * NS + 500 * MS)
    assert sync.round_trip == 500 * MS


def test_answers_to_others_and_second_answers_are_not_ours() -> None:
    sync = TimeSync(BootClock())
    (request,) = sync.due(0)
    sync.hear(mavlink.MAVLink_timesync_message(5, request.ts1 + 77), TICK)
    assert sync.round_trip is None
    for late in (1, 0):
        sync.hear(mavlink.MAVLink_timesync_message(5, request.ts1), TICK * (2 - late))
    assert sync.round_trip == TICK


def test_a_request_is_answered_in_its_own_time_once_that_is_known() -> None:
    clock = BootClock()
    sync = TimeSync(clock)
    request = mavlink.MAVLink_timesync_message(0, 77)
    assert sync.hear(request, 0) == []
    known(clock)
    (reply,) = sync.hear(request, NS)
    assert (reply.tc1, reply.ts1) == (NS - BOOTED, 77)


def test_a_reboot_forgets_round_trips() -> None:
    clock = known(BootClock())
    sync = TimeSync(clock)
    answers(sync, clock, NS)
    known(clock, 2 * NS, booted=NS)
    sync.hear(mavlink.MAVLink_timesync_message(0, 77), 3 * NS)
    assert sync.offset is None


def test_other_messages_are_nothing_to_it() -> None:
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3)
    assert TimeSync(BootClock()).hear(heartbeat, 0) == []
