"""When an emulated autopilot takes a sighting to have been true."""

from kybflow.core.signals import NS
from kybflow.drivers.emulated_autopilot.estimator import SightingClock

MS = NS // 1000


def seen(clock: SightingClock, late_by: int, first: int, count: int) -> list[int | None]:
    """By how many milliseconds each of `count` sightings is taken to be late."""
    out = []
    for now in range(first, first + count * 10 * MS, 10 * MS):
        at = clock.true_at(now - late_by * MS, now)
        out.append(None if at is None else (now - at) // MS)
    return out


def test_a_sighting_a_little_late_was_true_then():
    assert seen(SightingClock(None), 40, NS, 2) == [40, 40]


def test_px4_never_takes_one_that_is_older_than_its_filter_remembers():
    assert seen(SightingClock(None), 700, NS, 500) == [None] * 500


def test_ardupilot_takes_a_delay_that_lasts_for_an_error_of_the_clock():
    clock = SightingClock(100)
    assert seen(clock, 5000, NS // 2, 1) == [0]
    assert seen(clock, 0, NS // 2, 1) == [0]
    assert seen(clock, 700, NS, 102) == [None] * 100 + [0, 0]
    assert seen(clock, 10, 3 * NS, 2) == [0, 0]
    assert seen(clock, 100, 4 * NS, 2) == [90, 90]


def test_stamps_of_another_clock_count_as_their_arrival():
    assert seen(SightingClock(None), 60_000, NS, 2) == [0, 0]


def test_a_stamp_of_the_future_counts_as_its_arrival():
    assert seen(SightingClock(None), -40, NS, 2) == [0, 0]
