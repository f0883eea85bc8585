"""position_error: an alarm past the limit, nothing before it."""

from part_bench import DT, SITE, at_rest, estimate, tick

from kybflow.core.geometry import ZERO
from kybflow.core.signals import Alarm, Estimate, Reaction, Setpoint, SetpointKind
from kybflow.runtime.processors.position_error import PositionError, PositionErrorParams

PROCESSOR = PositionError(PositionErrorParams(), SITE)
KNOWN = estimate((0.0, 0.0, 1.0))


def test_past_the_limit_it_asks_to_brake() -> None:
    expected = Alarm(
        "position_error_exceeded",
        Reaction.BRAKE,
        "0.75 m from its setpoint, 0.5 m allowed",
        0.75,
        0.5,
        passes=True,
    )
    assert expected == PROCESSOR(at_rest((0.75, 0.0, 1.0)), tick(known=KNOWN))


def test_within_the_limit_the_setpoint_passes() -> None:
    near = at_rest((0.5, 0.0, 1.0))
    assert PROCESSOR(near, tick(known=KNOWN)) is near


def test_a_vehicle_that_has_just_lifted_off_may_be_further_away_until_it_has_met_the_wind() -> None:
    processor = PositionError(PositionErrorParams(), SITE)

    def alarms(height: float, away: float) -> bool:
        return isinstance(processor(at_rest((away, 0.0, height)), tick(known=at(height))), Alarm)

    def at(height: float) -> Estimate:
        return estimate((0.0, 0.0, height))

    assert [alarms(0.0, 0.4), alarms(0.0, 0.6)] == [False, True]
    assert [alarms(0.1, 0.6), alarms(0.1, 0.9)] == [False, True]
    assert not any(alarms(0.1, 0.6) for _ in range(round(2.9 / DT)))
    assert any(alarms(1.0, 0.6) for _ in range(round(0.2 / DT)))
    assert alarms(0.0, 0.6)


def test_a_vehicle_that_is_taken_over_in_the_air_may_not() -> None:
    processor = PositionError(PositionErrorParams(), SITE)
    for height in (1.0, 1.1):
        output = processor(at_rest((0.6, 0.0, height)), tick(known=estimate((0.0, 0.0, height))))
        assert isinstance(output, Alarm)


def behind(speed: float, seconds: float, known: float = 0.0) -> Setpoint | Alarm:
    """Asked for `speed` to the east, flying `known`."""
    processor = PositionError(PositionErrorParams(), SITE)
    velocity = Setpoint(SetpointKind.VELOCITY, None, (speed, 0.0, 0.0), ZERO)
    for i in range(round(seconds / DT)):
        flown = estimate((0.0, 0.0, 1.0), (known, 0.0, 0.0))
        output = processor(velocity, tick(i * DT, known=flown))
    return output


def test_a_vehicle_that_is_held_back_falls_behind_its_velocity() -> None:
    assert isinstance(behind(0.5, 1.0), Setpoint)
    alarm = behind(0.5, 2.0)
    assert isinstance(alarm, Alarm)
    assert alarm.reason == "0.63 m from its setpoint, 0.5 m allowed"


def test_a_velocity_that_is_nearly_flown_passes_for_ever() -> None:
    assert isinstance(behind(0.8, 60.0, known=0.6), Setpoint)


def test_an_acceleration_passes() -> None:
    pushing = Setpoint(SetpointKind.ACCELERATION, None, None, (9.0, 0.0, 0.0))
    assert PROCESSOR(pushing, tick(known=KNOWN)) is pushing
