"""setpoint: heard when what the tracker follows jumps or runs away."""

from part_bench import DT, SITE, at_rest, estimate, tick

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Alarm, Reaction, SetpointKind
from kybflow.runtime.supervisors.setpoint import SetpointSupervisor, SetpointSupervisorParams

HERE = (0.0, 0.0, 1.0)


def following(i: int, east: float, own: Vec3 = HERE, speed: float = 0.0):
    setpoint = at_rest((east, 0.0, 1.0), (speed, 0.0, 0.0))
    return tick(i * DT, estimate(own), setpoint)


def heard(*ticks, off_ground: bool = True) -> list[Alarm | None]:
    supervisor = SetpointSupervisor(SetpointSupervisorParams(), SITE)
    return [supervisor.check(one, off_ground) for one in ticks]


def test_a_step_away_from_the_vehicle_brakes_for_a_moment() -> None:
    expected = Alarm(
        "setpoint_jumped", Reaction.BRAKE, "its setpoint stepped by 0.60 m, 0.5 m allowed", 0.6, 0.5
    )
    ticks = [following(0, 0.0), following(1, 0.6), following(2, 0.6), following(40, 0.6)]
    assert heard(*ticks) == [None, expected, expected, None]


def test_a_step_back_to_the_vehicle_does_no_harm() -> None:
    assert heard(following(0, 0.9), following(1, 0.0)) == [None, None]


def test_a_fast_setpoint_is_no_step() -> None:
    away = [following(i, 200.0 * i * DT, (200.0 * i * DT, 0.0, 1.0), 200.0) for i in range(9)]
    assert heard(*away) == [None] * 9


def test_a_setpoint_that_is_too_far_away_brakes() -> None:
    far = [following(i, 0.4 * i) for i in range(4)]
    expected = Alarm(
        "setpoint_left",
        Reaction.BRAKE,
        "its setpoint is at a distance of 1.20 m, 1 m allowed",
        1.2,
        1.0,
    )
    last = heard(*far)[-1]
    assert last is not None
    assert last._replace(value=round(last.value, 9)) == expected


def test_without_a_position_without_an_estimate_and_on_the_ground_it_is_silent() -> None:
    velocity = at_rest(HERE)._replace(kind=SetpointKind.VELOCITY, position=None)
    assert heard(tick(0.0, estimate(HERE), velocity)) == [None]
    assert heard(tick(0.0, None, at_rest((9.0, 0.0, 1.0)))) == [None]
    assert heard(following(0, 9.0), off_ground=False) == [None]
