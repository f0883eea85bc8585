"""jump: heard when a measurement is not where the last one's motion leads."""

import pytest
from part_bench import SITE, estimate, tick

from kybflow.core.signals import NS, Alarm, Reaction, Tick
from kybflow.runtime.supervisors.jump import Jump, JumpParams

PERIOD = 0.01


def seen(time: float, east: float, speed: float = 0.0, age: float = 0.0, source: str = "mocap"):
    known = estimate((east, 0.0, 1.0), (speed, 0.0, 0.0), now=round(time * NS), age=age)
    return tick(time, known._replace(source=source))


def heard(*ticks: Tick, off_ground: bool = True, **more: object) -> list[Alarm | None]:
    supervisor = Jump(JumpParams(**more), SITE)
    return [supervisor.check(one, off_ground) for one in ticks]


def test_a_step_of_half_a_metre_asks_to_land_blind_for_a_second():
    steady = [seen(i * PERIOD, 0.0) for i in range(20)]
    alarms = heard(*steady, seen(0.2, 0.5), seen(0.21, 0.5), seen(1.19, 0.5), seen(1.21, 0.5))
    expected = Alarm(
        "jumped",
        Reaction.LAND_BLIND,
        "its position jumped by 0.50 m, 0.10 m allowed",
        0.5,
        pytest.approx(0.10025),
    )
    assert alarms == [None] * 20 + [expected, expected, expected, None]


def test_a_fast_vehicle_and_a_gap_in_its_measurements_are_no_jump():
    times = [0.0, 0.01, 0.02, 0.3, 0.31, 0.9]
    assert heard(*(seen(t, 2.0 * t, speed=2.0) for t in times)) == [None] * 6


def test_a_vehicle_that_stopped_while_nobody_looked_has_not_jumped():
    """The program hung for 1.6 s, in which a vehicle that climbed at 0.5 m/s was landed."""
    flown = [seen(i * PERIOD, 0.5 * i * PERIOD, speed=0.5) for i in range(20)]
    assert heard(*flown, seen(1.8, 0.1), seen(1.81, 0.1))[20:] == [None, None]


def test_the_bound_grows_with_the_time_since_the_velocity_was_measured():
    """Within 0.18 s, a vehicle that brakes at 5 m/s^2 ends 8 cm short of where it was going; the
    usual 10 cm are for the noise."""
    flown = [seen(i * PERIOD, 0.0) for i in range(20)]
    assert heard(*flown, seen(0.37, 0.17))[-1] is None
    assert heard(*flown, seen(0.37, 0.19))[-1] is not None
    old = [seen(i * PERIOD, 0.0, age=0.1) for i in range(20)]
    assert heard(*old, seen(0.27, 0.15))[-1] is None
    assert heard(*flown, seen(0.27, 0.15))[-1] is not None


def test_below_at_least_nothing_is_a_jump():
    assert heard(seen(0.0, 0.0), seen(0.01, 0.09)) == [None, None]


def test_a_position_that_always_jitters_has_a_higher_bound():
    jitter = [seen(i * PERIOD, 0.08 * (i % 2)) for i in range(200)]
    assert heard(*jitter, seen(2.0, 0.25))[-1] is None
    assert heard(*jitter, seen(2.0, 0.25), factor=2.0)[-1] is not None


def test_a_measurement_is_judged_once():
    steady = [seen(i * PERIOD, 0.0) for i in range(20)]
    same = seen(0.2, 0.5, age=0.2 - 19 * PERIOD)
    assert heard(*steady, same)[-1] is None


def test_another_estimator_begins_anew():
    assert heard(seen(0.0, 0.0), seen(0.01, 0.5, source="tags")) == [None, None]


def test_on_the_ground_it_is_silent_and_forgets():
    assert heard(seen(0.0, 0.0), seen(0.01, 0.5), off_ground=False) == [None, None]
