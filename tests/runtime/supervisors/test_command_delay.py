"""command_delay: hears that the vehicle acts late, from what it was asked for and how it moves."""

from __future__ import annotations

import random
from math import cos, sin, sqrt

import pytest
from part_bench import SITE, estimate, tick
from short_flights import fault, hovers, named

from kybflow.core.geometry import GRAVITY, ZERO, from_euler
from kybflow.core.signals import NS, Command, Imu, Reaction, Tick
from kybflow.runtime.supervisors.command_delay import CommandDelay, CommandDelayParams
from kybflow.world.vehicle_context import InnerLoop, attitude_loop

STEP, PERIOD, RATE = 0.024, 0.008, 8.0
LOOP = InnerLoop(attitude_loop(0.03, None, None), 0.03, command_latency=0.01)
DECLARED = LOOP.command_latency + LOOP.rotor_time / LOOP.attitude.lead + 1.5 * PERIOD
CONTEXT = SITE._replace(loop=LOOP, delay_margin=0.05, dt=PERIOD)
WEIGHT = CONTEXT.airframe.hover_thrust


def swinging(time: float, late: float, roll: float, thrust: float, noise: random.Random) -> Tick:
    """What a vehicle shows that obeys sinusoidal commands as declared, and `late`. roll: rad.
    thrust: a share of the weight."""

    def shape(t: float) -> tuple[float, float]:
        return sin(RATE * t), RATE * cos(RATE * t)

    asked, turning = shape(time)
    done, turned = shape(time - DECLARED - late)
    command = Command(
        from_euler(roll * asked, 0.0, 0.0), WEIGHT * (1.0 + thrust * asked),
        (roll * turning, 0.0, 0.0), 0.0,
    )  # fmt: skip
    now = round(time * NS)
    seen = estimate((0.0, 0.0, 1.0), now=now)._replace(attitude=from_euler(roll * done, 0.0, 0.0))
    shaken = noise.gauss(0.0, 0.5)
    force = (0.0, 0.0, GRAVITY * (1.0 + thrust * done) + shaken)
    imu = Imu(now, PERIOD, force, (roll * turned + noise.gauss(0.0, 0.01), 0.0, 0.0))
    return tick(time, seen)._replace(command=command, imu=imu)


def heard(
    late: float,
    roll: float = 0.15,
    thrust: float = 0.0,
    supervisor: CommandDelay | None = None,
    **changed: object,
):
    """The first alarm within 4 s, and when."""
    supervisor = supervisor or CommandDelay(CommandDelayParams(), CONTEXT)
    noise = random.Random(0)
    for step in range(round(4.0 / STEP)):
        seen = swinging(step * STEP, late, roll, thrust, noise)._replace(**changed)
        alarm = supervisor.check(seen, off_ground=True)
        if alarm is not None:
            return alarm, step * STEP
    return None, None


@pytest.mark.parametrize(("roll", "thrust"), [(0.15, 0.0), (0.0, 0.4)])
@pytest.mark.parametrize("late", [0.06, 0.1, 0.15])
def test_late_commands_show_in_a_swinging_vehicle(late, roll, thrust):
    alarm, time = heard(late, roll, thrust)
    assert alarm is not None
    assert (alarm.event, alarm.reaction) == ("commands_late", Reaction.LAND_BLIND)
    assert alarm.is_failure
    assert sin(RATE * late) / RATE - 0.02 < alarm.value < late + 0.02
    assert alarm.late == alarm.value
    assert time < 2.0


@pytest.mark.parametrize(("roll", "thrust"), [(0.15, 0.0), (0.0, 0.4)])
@pytest.mark.parametrize("late", [0.0, 0.03])
def test_punctual_commands_are_not_late(late, roll, thrust):
    assert heard(late, roll, thrust) == (None, None)


def test_a_vehicle_that_does_not_move_shows_nothing():
    assert heard(0.2, roll=0.0, thrust=0.0) == (None, None)


def test_a_smaller_share_of_the_margin_is_used_up_sooner():
    strict = CommandDelay(CommandDelayParams(share=0.5), CONTEXT)
    alarm, _ = heard(0.03, supervisor=strict)
    assert alarm is not None
    assert alarm.bound == 0.025


@pytest.mark.parametrize(
    "changed",
    [
        {"imu": None},
        {"estimate": None},
        {"command": None},
        {"command": Command((1.0, 0.0, 0.0, 0.0), 0.0, ZERO, None)},
        {"link_delay": 0.05},
    ],
)
def test_what_can_not_be_compared_is_not_judged(changed):
    assert heard(0.15, **changed) == (None, None)


def test_without_a_known_margin_nothing_is_judged():
    unknown = CONTEXT._replace(delay_margin=None)
    assert heard(0.15, supervisor=CommandDelay(CommandDelayParams(), unknown)) == (None, None)
    assert CommandDelay.can_emit(unknown) == ()
    assert CommandDelay.can_emit(CONTEXT) == ("commands_late",)


def test_gusts_that_the_loop_answers_are_no_delay():
    """Disturbances tilt the vehicle, and what is asked for follows, instead of the reverse."""
    supervisor, noise = CommandDelay(CommandDelayParams(), CONTEXT), random.Random(1)
    tilt, asked, before = 0.0, 0.0, [0.0] * 3
    for step in range(round(20.0 / STEP)):
        tilt += sqrt(STEP) * noise.gauss(0.0, 0.05) - STEP * 2.0 * tilt
        before = [*before[1:], asked]
        obeyed = tilt + before[0]
        asked += STEP * (-4.0 * obeyed - 2.0 * asked)
        now = round(step * STEP * NS)
        known = estimate(ZERO, now=now)._replace(attitude=from_euler(obeyed, 0.0, 0.0))
        seen = tick(step * STEP, known)._replace(
            command=Command(from_euler(asked, 0.0, 0.0), WEIGHT, ZERO, 0.0),
            imu=Imu(now, PERIOD, (0.0, 0.0, GRAVITY), ZERO),
        )
        assert supervisor.check(seen, off_ground=True) is None


def test_an_alarm_lasts_until_the_vehicle_is_down():
    supervisor = CommandDelay(CommandDelayParams(), CONTEXT)
    alarm, time = heard(0.1, supervisor=supervisor)
    still = tick(time + STEP, estimate(ZERO))
    assert supervisor.check(still, off_ground=True) == alarm
    assert supervisor.check(still, off_ground=False) is None
    assert supervisor.check(still, off_ground=True) is None


@pytest.mark.parametrize("late", [0.1, pytest.param(0.15, marks=pytest.mark.thorough)])
def test_a_flight_with_late_commands_ends_soon_gently_and_near(run, late):
    most = [0.0]

    def look(engine):
        [vehicle] = engine.vehicles
        if vehicle.truth is not None:
            most[0] = max(most[0], *(abs(c) for c in vehicle.truth.position[:2]))

    flown, told = run(hovers(3.0), faults=(fault("clock_late", 4.0, by=late),), observers=(look,))
    [begun], [alarm] = named(told, "fault_injected"), named(told, "commands_late")
    assert (alarm.time - begun.time) / NS < 3.0
    assert named(told, "landed_hard", "collided", "fence_breached") == []
    assert most[0] < 1.5
    assert flown.summary["outcome"] == "failed"
    assert "commands act" in flown.summary["reason"]


@pytest.mark.thorough
def test_a_flight_whose_commands_are_30_ms_late_goes_on(run):
    flown, told = run(hovers(4.0), faults=(fault("clock_late", 4.0, by=0.03),))
    assert named(told, "commands_late") == []
    assert flown.summary["outcome"] == "succeeded"
