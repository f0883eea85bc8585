"""on_board: what the vehicle's own controller is handed, and that it is flown well by it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from onboard_control import following
from plans import part, state, then, vehicle
from short_flights import down, hold, up

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Vec3,
    from_euler,
    from_heading,
    from_thrust_direction,
    norm,
    scale,
    sub,
)
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.flight.steering import LEAST_LIFT, MOST_THRUST
from kybflow.runtime.finite import checked_command
from kybflow.runtime.trackers.on_board import OnBoard, OnBoardParams
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05, drag=0.3,
)  # fmt: skip
DT = 0.004
UP: Vec3 = (0.0, 0.0, 1.0)


def on_board(by: str, frame: Airframe = FRAME, **params) -> OnBoard:
    return OnBoard(OnBoardParams(by=by, **params), VehicleContext("a", frame, ZERO, 0.0, None, DT))


def tick(where: Vec3 = UP, speed: Vec3 = ZERO, dt: float = DT, attitude=LEVEL) -> Tick:
    known = Estimate(0, where, speed, attitude, ZERO, "mocap", 0.0, 0.0)
    return Tick(0, dt, 0.0, known, None, None, {})


def position(at: Vec3 = UP, speed: Vec3 = ZERO, push: Vec3 = ZERO) -> Setpoint:
    return Setpoint(SetpointKind.POSITION, at, speed, push, (0.1, 0.2, 0.3), 0.5, 0.25)


MOVING = Setpoint(SetpointKind.VELOCITY, None, (0.3, 0.0, 0.0), heading_rate=0.5)
PUSHED = Setpoint(SetpointKind.ACCELERATION, None, None, (0.5, 0.0, 0.1), heading=1.0)


def pushed(command: Command) -> Vec3:
    """The acceleration that is asked for."""
    assert command.kind is CommandKind.ACCELERATION
    setpoint = command.setpoint
    assert setpoint is not None
    assert setpoint.acceleration is not None
    assert (setpoint.position, setpoint.velocity) == (None, None)
    return setpoint.acceleration


@pytest.mark.parametrize("setpoint", [position(), MOVING, PUSHED], ids=lambda s: s.kind.value)
def test_by_position_everything_is_passed_on_as_it_is(setpoint: Setpoint) -> None:
    command = on_board("position").update(setpoint, tick(attitude=from_heading(0.25)))
    assert command.setpoint is setpoint
    assert command.kind.value == setpoint.kind.value
    assert command.heading == pytest.approx(0.25)
    assert checked_command(command) is command


def test_it_says_what_it_gives() -> None:
    own = {SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION}
    assert own == OnBoard.accepts
    given = {by: {k.value for k in OnBoard.kinds(OnBoardParams(by=by))} for by in
             ("position", "velocity", "acceleration")}  # fmt: skip
    assert given == {
        "position": {"position", "velocity", "acceleration"},
        "velocity": {"velocity", "acceleration"},
        "acceleration": {"acceleration"},
    }


def test_it_knows_no_mass_but_the_airframes() -> None:
    tracker = on_board("position")
    assert tracker.hover_thrust == FRAME.mass * GRAVITY
    assert tracker.update(position(), tick()).thrust == FRAME.mass * GRAVITY


def test_by_velocity_the_position_error_moves_the_velocity() -> None:
    setpoint = position((0.1, 0.0, 1.0), (0.2, 0.0, 0.0), (0.4, 0.0, 0.0))
    command = on_board("velocity", proportional=1.5).update(setpoint, tick())
    assert command.kind is CommandKind.VELOCITY
    sent = command.setpoint
    assert sent is not None
    assert sent.kind is SetpointKind.VELOCITY
    assert sent.position is None
    assert sent.velocity == pytest.approx((0.2 + 1.5 * 0.1, 0.0, 0.0))
    assert (sent.acceleration, sent.jerk) == (setpoint.acceleration, setpoint.jerk)
    assert (sent.heading, sent.heading_rate) == (0.5, 0.25)


@given(gap=st.tuples(*[st.floats(-50.0, 50.0)] * 3), most=st.floats(0.1, 2.0))
def test_by_velocity_the_correction_is_bounded_and_points_home(gap: Vec3, most: float) -> None:
    tracker = on_board("velocity", correction=most)
    sent = tracker.update(position(gap, (0.3, 0.0, 0.0)), tick(ZERO)).setpoint
    assert sent is not None
    assert sent.velocity is not None
    more = sub(sent.velocity, (0.3, 0.0, 0.0))
    assert norm(more) <= most + 1e-9
    length = min(1.2 * norm(gap), most)
    assert more == pytest.approx(scale(gap, length / norm(gap)) if norm(gap) else ZERO, abs=1e-6)


@pytest.mark.parametrize(("by", "setpoint"), [("velocity", MOVING), ("velocity", PUSHED),
                                              ("acceleration", PUSHED)])  # fmt: skip
def test_what_it_need_not_change_is_passed_on(by: str, setpoint: Setpoint) -> None:
    assert on_board(by).update(setpoint, tick()).setpoint is setpoint


def test_by_acceleration_it_is_the_cascades_law() -> None:
    params = {"stiffness": 4.0, "damping": 3.0, "integral": 0.0}
    setpoint = position((0.1, -0.05, 1.02), (0.2, 0.0, 0.1), (0.1, 0.0, -0.1))
    command = on_board("acceleration", **params).update(setpoint, tick(speed=(0.05, 0.02, 0.0)))
    assert pushed(command) == pytest.approx(
        (
            0.1 + 3.0 * 0.15 + 4.0 * 0.1 + 0.3 * 0.2,
            3.0 * -0.02 + 4.0 * -0.05,
            -0.1 + 3.0 * 0.1 + 4.0 * 0.02,
        )
    )


def test_where_the_height_is_kept_on_board_its_loop_is_half_as_quick() -> None:
    params = {"stiffness": 4.0, "damping": 3.0, "integral": 1.0, "keeps_height": True}
    tracker, setpoint = on_board("acceleration", **params), position((0.0, 0.0, 1.2))
    tracker.update(position(), tick(ZERO))
    first = pushed(tracker.update(setpoint, tick(speed=(0.0, 0.0, -0.1))))
    assert first == pytest.approx((0.0, 0.0, 0.5 * 3.0 * 0.1 + 0.25 * 4.0 * 0.2))
    after = pushed(tracker.update(setpoint, tick(speed=(0.0, 0.0, -0.1))))
    assert after == first, "no steady push is left to it"


def landed_on_copter(tracker: OnBoard) -> float:
    """The speed of a touch-down from 1 m with the height loop of Copter 4.5 between, whose gains
    are its maker's: position 1, velocity 5, acceleration 1.3 and 2.5, 5 m/s^3 of jerk. The rotors
    take 50 ms, the way 50 ms, and the estimate of the climb comes 100 ms late."""
    height, speed, known, summed, wanted, total = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    place, goal, sinks, push, way = 1.0, 1.0, 0.0, 0.0, [0.0] * 5
    tracker.update(position(ZERO), tick(ZERO, dt=0.01))
    while height > 0.03:
        slow = min(0.5, (0.04 + 1.4 * max(goal - 0.4, 0.0)) ** 0.5)
        pull = min(max(-slow - sinks, -0.007), 0.007)
        goal, sinks = goal + (sinks + 0.5 * pull) * 0.01, sinks + pull
        known += (speed - known) * 0.01 / 0.11
        setpoint = position((0.0, 0.0, goal), (0.0, 0.0, sinks), (0.0, 0.0, pull / 0.01))
        way.append(
            pushed(tracker.update(setpoint, tick((0.0, 0.0, height), (0.0, 0.0, known), dt=0.01)))[
                2
            ]
        )
        wanted += min(max(way.pop(0) - wanted, -0.05), 0.05)
        summed += wanted * 0.01
        place += summed * 0.01
        lacks = wanted + 5.0 * (summed + place - height - speed) - push
        total += 2.5 * lacks * 0.01
        push += (1.3 * lacks + total - push) * 0.01 / 0.06
        speed += push * 0.01
        height += speed * 0.01
    return -speed


def test_a_slow_landing_on_an_autopilot_that_keeps_the_height_is_slow() -> None:
    assert landed_on_copter(on_board("acceleration", keeps_height=True)) < 0.3
    assert landed_on_copter(on_board("acceleration")) > 0.5, "it swings"


@given(wanted=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), more=st.floats(0.0, 2.0))
def test_by_acceleration_what_the_tilt_lacks_is_asked_for_besides(wanted, more: float) -> None:
    params = {"tilt": more, "integral": 0.0, "lift_off": 0.0}
    tracker, has = on_board("acceleration", **params), (0.4, -0.3)
    tilted = from_thrust_direction((*has, GRAVITY), 0.7)
    setpoint = position(push=(*wanted, 0.0))
    tracker.update(setpoint, tick(ZERO, attitude=tilted))
    sent = pushed(tracker.update(setpoint, tick(attitude=tilted)))
    assert sent == pytest.approx(
        (*(a + more * (a - b) for a, b in zip(wanted, has, strict=True)), 0.0)
    )


def test_by_acceleration_the_tilt_is_nothing_on_the_ground_and_on_its_side() -> None:
    leant, side = from_euler(0.2, 0.0, 0.0), from_euler(1.2, 0.0, 0.0)
    tracker, wanted = on_board("acceleration", integral=0.0), position(push=(0.2, 0.0, 0.0))
    low = pushed(tracker.update(wanted._replace(position=ZERO), tick(ZERO, attitude=leant)))
    assert low == pytest.approx((0.2, 0.0, 0.0))
    assert pushed(tracker.update(wanted, tick(attitude=side))) == pytest.approx((0.2, 0.0, 0.0))


def test_by_acceleration_a_velocity_is_tilted_too_and_leaves_the_integral() -> None:
    tracker = on_board("acceleration", lift_off=0.0, damping=3.0)
    tracker.update(MOVING, tick(ZERO))
    level = pushed(tracker.update(MOVING, tick()))
    leant = pushed(tracker.update(MOVING, tick(attitude=from_euler(0.1, 0.0, 0.0))))
    assert leant[1] > level[1] + 0.3
    for _ in range(100):
        assert pushed(tracker.update(MOVING, tick())) == level
    tracker.update(position((0.0, 0.0, 1.1)), tick())
    assert pushed(tracker.update(position(), tick()))[2] > 0.0, "it integrates from there on"


def test_by_acceleration_the_jerk_goes_along_where_nothing_is_cut() -> None:
    tracker = on_board("acceleration")
    near, far = position((0.01, 0.0, 1.0)), position((9.0, 0.0, 1.0))
    assert tracker.update(near, tick()).setpoint.jerk == near.jerk
    assert tracker.update(far, tick()).setpoint.jerk is None


def test_by_acceleration_a_velocity_has_no_pull() -> None:
    command = on_board("acceleration", damping=3.0).update(MOVING, tick((5.0, 5.0, 1.0)))
    assert pushed(command) == pytest.approx((3.0 * 0.3 + 0.3 * 0.3, 0.0, 0.0))


def test_its_integral_takes_a_steady_push_along_every_axis() -> None:
    tracker, place, speed = on_board("acceleration"), [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]
    for _ in range(10000):
        sent = pushed(tracker.update(position((0.0, 0.0, 1.0)), tick(tuple(place), tuple(speed))))
        for axis, push in enumerate((0.3, -0.2, -0.4)):
            speed[axis] += DT * (sent[axis] + push)
            place[axis] += DT * speed[axis]
    assert place == pytest.approx([0.0, 0.0, 1.0], abs=2e-3)


@pytest.mark.parametrize(
    ("where", "dt"), [(ZERO, DT), ((0.0, 0.0, 0.5), 0.05), ((9.0, 0.0, 0.5), DT)],
    ids=["on the ground", "in a long step", "at a limit"],
)  # fmt: skip
def test_its_integral_stands_still(where: Vec3, dt: float) -> None:
    tracker, goal = on_board("acceleration"), position((where[0] - 0.01, 0.0, where[2]))
    if where[0]:
        goal = position((0.0, 0.0, 0.5))
    tracker.update(position(), tick(ZERO))
    first = pushed(tracker.update(goal, tick(where, dt=dt)))
    for _ in range(500):
        last = pushed(tracker.update(goal, tick(where, dt=dt)))
    assert last == first


@given(
    where=st.tuples(*[st.floats(-50.0, 50.0)] * 3), speed=st.tuples(*[st.floats(-20.0, 20.0)] * 3)
)
def test_whatever_the_error_it_asks_for_no_more_than_the_airframe_has(
    where: Vec3, speed: Vec3
) -> None:
    tracker = on_board("acceleration")
    x, y, z = pushed(tracker.update(position(), tick(where, speed)))
    assert LEAST_LIFT * GRAVITY - 1e-9 <= z + GRAVITY <= MOST_THRUST * FRAME.max_thrust + 1e-9
    assert (x * x + y * y) ** 0.5 <= (z + GRAVITY) * 0.3641 + 1e-9  # tan(FRAME.tilt)


@pytest.mark.parametrize(
    "by",
    [
        "position",
        *(pytest.param(b, marks=pytest.mark.thorough) for b in ("velocity", "acceleration")),
    ],
)
def test_a_vehicle_that_follows_setpoints_flies_a_mission_by_it(run, by: str) -> None:
    driver, opened = following()
    go = part("behaviors", "fly_to", position=(0.8, -0.4, 0.8))
    states = [up("go"), state("go", go, then("hold")), hold(1.0, "down"), down()]
    tracker = part("trackers", "on_board", by=by)
    flown, _ = run(vehicle("a", states, tracker=tracker, driver=driver))
    assert flown.summary["outcome"] == "succeeded"
    assert flown.summary["vehicles"]["a"]["final"] == "ground"
    scores = {b["name"]: b for b in flown.summary["vehicles"]["a"]["behaviors"]}
    assert scores["go"]["ended"] == "done"
    assert scores["hold"]["position_error_m"]["max"] < 0.05
    assert opened["a"].kinds == {CommandKind(by)}
