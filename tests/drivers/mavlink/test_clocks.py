"""The clock of an autopilot: stamps in the run's time, reboots, round trips, answers."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from framing import PX4_HEARTBEAT
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.telemetry.clocks import (
    MS,
    PERIOD_NS,
    SIMULATOR_BUCKET,
    BootClock,
    TimeSync,
    boot_time,
)

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


def test_a_simulator_that_falls_behind_is_followed() -> None:
    """It is slow by 0.5 % and stops for 0.1 s; then kybflow hangs for 2 s."""
    clock, boot, errors = BootClock(SIMULATOR_BUCKET), -BOOTED, dict[int, Time]()
    for tick in range(2000):
        boot += 0 if 500 <= tick < 525 else round(TICK * 0.995)
        if not 1000 <= tick < 1500:
            errors[tick] = tick * TICK - clock.to_run(boot, tick * TICK)
    assert max(errors[tick] for tick in errors if tick < 500 or 600 <= tick < 1500) < 2 * MS
    assert max(errors[tick] for tick in errors if tick >= 1500) < 16 * MS
    assert max(errors[tick] for tick in errors if tick >= 1575) < 2 * MS
    held = known(BootClock(SIMULATOR_BUCKET))
    stamps = [held.to_run(NS + t * MS - BOOTED, 3 * NS) - NS for t in range(0, 2000, 10)]
    assert stamps == [t * MS for t in range(0, 2000, 10)]


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
        (PX4_HEARTBEAT, None),
    ],
    ids=["milliseconds", "not filled in", "microseconds", "time of day", "no stamp"],
)
def test_the_stamp_of_a_message(message: object, expected: Time | None) -> None:
    assert boot_time(message) == expected


def answers(sync: TimeSync, *delays: Time, since: Time = 0) -> list[Time]:
    """Each request is answered after one of these delays, also after the next was sent; when they
    were asked."""
    asked: list[Time] = []
    coming: list[tuple[Time, object]] = []
    last = since + len(delays) * PERIOD_NS
    for now in range(since, last + max(delays) + 1, TICK):
        for due, reply in [one for one in coming if one[0] <= now]:
            coming.remove((due, reply))
            assert sync.handle(reply, now) == []
        for request in sync.due(now) if now < last else ():
            assert request.tc1 == 0
            due = now + delays[len(asked)]
            coming.append((due, mavlink.MAVLink_timesync_message(due - BOOTED, request.ts1)))
            asked.append(now)
    return asked


def test_it_asks_five_times_a_second() -> None:
    asked = answers(TimeSync(BootClock()), *[TICK] * 5)
    assert [0, *[NS // 5] * 4] == [asked[0], *(later - time for time, later in pairwise(asked))]


def test_the_round_trip_is_the_shorter_one_of_the_newest_two() -> None:
    sync = TimeSync(BootClock())
    answers(sync, TICK)
    assert sync.round_trip == 0.0, "one is none yet"
    answers(sync, 100 * TICK, 2 * TICK, since=NS)
    assert sync.round_trip == 2 * TICK / NS, "a single slow one is a hiccup"
    answers(sync, 100 * TICK, 101 * TICK, since=3 * NS)
    assert sync.round_trip == 100 * TICK / NS


@pytest.mark.parametrize("held", range(0, 1000, 90))
def test_messages_that_were_held_back_and_come_at_once_are_no_slow_link(held: int) -> None:
    sync = TimeSync(BootClock())
    asked = [request for time in range(0, held + 1, 4) for request in sync.due(time * MS)]
    for request in asked:
        sync.handle(mavlink.MAVLink_timesync_message(5, request.ts1), held * MS)
    assert sync.round_trip <= PERIOD_NS / NS


def test_answers_to_others_and_second_answers_are_not_ours() -> None:
    sync = TimeSync(BootClock())
    (request,) = sync.due(0)
    for stamp in (request.ts1 + 77, request.ts1 + 77, request.ts1, request.ts1):
        sync.handle(mavlink.MAVLink_timesync_message(5, stamp), TICK)
    assert sync.round_trip == 0.0, "only one of them was an answer"


def test_a_request_is_answered_in_its_own_time_once_that_is_known() -> None:
    clock = BootClock()
    sync = TimeSync(clock)
    request = mavlink.MAVLink_timesync_message(0, 77)
    assert sync.handle(request, 0) == []
    known(clock)
    (reply,) = sync.handle(request, NS)
    assert (reply.tc1, reply.ts1) == (NS - BOOTED, 77)


def test_other_messages_are_nothing_to_it() -> None:
    heartbeat = PX4_HEARTBEAT
    assert TimeSync(BootClock()).handle(heartbeat, 0) == []
