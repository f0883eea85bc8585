"""The stream of setpoints, setpoints ahead of their time, and those that lift a vehicle."""

from __future__ import annotations

import pytest
from framing import ARM
from hypothesis import given
from hypothesis import strategies as st
from scripted_autopilot import RESTING, STREAM, Bench, at, pushed, standing

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, CommandKind, Setpoint, SetpointKind
from kybflow.drivers.mavlink.control.arming import LIFTED_BY
from kybflow.drivers.mavlink.control.setpoints import Latency, SetpointStream, compensated, raised

MS = NS // 1000


def sent(stream, start, end, step=4, feeds=None):
    """When (ms) something was due."""
    times = []
    for ms in range(start, end, step):
        if feeds is not None:
            stream.feed(feeds, ms * MS)
        if stream.due(ms * MS) is not None:
            times.append(ms)
    return times


def test_set_points_go_out_at_their_own_rate():
    times = sent(SetpointStream(50.0), 0, 1000, feeds=at((0.0, 0.0, 1.0)))
    assert times == list(range(0, 1000, 20))


def test_a_rate_that_does_not_divide_the_tick_is_kept_on_average():
    times = sent(SetpointStream(30.0), 0, 10_000, feeds=at((0.0, 0.0, 1.0)))
    assert len(times) == 300


def test_the_newest_command_is_resent_until_it_is_250_ms_old():
    stream = SetpointStream(50.0)
    stream.feed(at((0.0, 0.0, 1.0)), 0)
    assert sent(stream, 0, 2000)[-1] == 240
    assert stream.flows(2000 * MS) == 0.0


def test_a_late_tick_is_not_caught_up_by_a_burst():
    stream = SetpointStream(50.0)
    command = at((0.0, 0.0, 1.0))
    sent(stream, 0, 100, feeds=command)
    stream.feed(command, 300 * MS)
    assert len(sent(stream, 300, 340)) == 2


def test_a_stream_that_stopped_begins_anew():
    stream = SetpointStream(50.0)
    sent(stream, 0, 2000, feeds=at((0.0, 0.0, 1.0)))
    stream.stop()
    assert stream.due(2000 * MS) is None
    stream.feed(at((0.0, 0.0, 1.0)), 3000 * MS)
    assert stream.flows(3500 * MS) == 0.5


MOVING = Setpoint(
    SetpointKind.POSITION, (1.0, 2.0, 0.1), (0.0, 0.0, 0.3), (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), 0.7
)


@given(st.floats(0.0, 3.0))
def test_a_place_is_raised_and_rests_there(height):
    command = at(ZERO)._replace(setpoint=MOVING)
    higher = raised(command, height, 0.0)
    assert higher.setpoint.position == pytest.approx((1.0, 2.0, 0.1 + height))
    assert higher.setpoint[2:5] == (ZERO, ZERO, ZERO)
    assert higher == command._replace(setpoint=higher.setpoint)
    assert higher.setpoint.heading == 0.7


def test_what_is_no_place_stays_as_it_is():
    speed = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.0, 0.2), ZERO)
    climbing = at(ZERO)._replace(kind=CommandKind.VELOCITY, setpoint=speed)
    for command in (RESTING, climbing):
        assert raised(command, 0.5, 2.0) is command


def test_px4_obeys_once_set_points_above_the_first_have_lifted_it():
    bench = standing("px4")
    assert bench.arm(command=at((1.0, 2.0, 0.1)))
    assert bench.fake.position[2] >= LIFTED_BY
    lifting = [m for m in bench.fake.took(STREAM) if m.z == pytest.approx(-0.6)]
    assert lifting
    assert {(m.x, m.y, m.vz) for m in lifting} == {(2.0, 1.0, 0.0)}
    armed = bench.fake.sent.index(bench.fake.commands(ARM)[0])
    before = [m.z for m in bench.fake.sent[:armed] if m.get_type() == STREAM]
    assert before == pytest.approx([-0.1] * len(before))
    bench.fake.sent.clear()
    bench.run(0.5, at((1.0, 2.0, 0.2)))
    after = [m.z for m in bench.fake.took(STREAM)][2:]
    assert after == pytest.approx([-0.2] * len(after))


def test_one_that_does_not_rise_is_refused_and_rests():
    bench = standing("px4", arming_time=5.0)
    bench.fake.is_heavy = True
    with pytest.raises(Refused, match="has not left the ground"):
        bench.arm()
    bench.run(2.0, RESTING)
    assert not bench.fake.armed


def test_commands_of_velocity_lift_it_themselves():
    speed = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.0, 0.2), ZERO)
    bench = standing("px4")
    bench.fake.is_heavy = True
    assert bench.arm(command=at(ZERO)._replace(kind=CommandKind.VELOCITY, setpoint=speed))


@pytest.mark.parametrize(("seconds", "push"), [(0.0, 1.5), (2.0, 2.5), (60.0, 4.0)])
def test_an_acceleration_is_pushed_up_by_what_grows_to_a_bound_and_keeps_its_place(seconds, push):
    sideways = Setpoint(
        SetpointKind.ACCELERATION, None, None, (0.3, 0.0, -1.0), (0.0, 0.0, 9.0), 0.7
    )
    command = pushed(0.0)._replace(setpoint=sideways)
    harder = sideways._replace(acceleration=(0.3, 0.0, push), jerk=ZERO)
    assert raised(command, 0.5, seconds) == command._replace(setpoint=harder)


def test_px4_obeys_by_acceleration_once_a_push_up_has_lifted_it():
    bench = standing("px4")
    assert bench.arm(command=pushed(-0.5))
    assert bench.fake.position[2] >= LIFTED_BY
    armed = bench.fake.sent.index(bench.fake.commands(ARM)[0])
    before = [m.afz for m in bench.fake.sent[:armed] if m.get_type() == STREAM]
    assert before == pytest.approx([0.5] * len(before))
    lifting = [m.afz for m in bench.fake.took(STREAM) if m.afz < 0.0]
    assert lifting[0] == pytest.approx(-1.5, abs=0.1)
    assert lifting == sorted(lifting, reverse=True)
    bench.fake.sent.clear()
    bench.run(0.5, pushed(-0.5))
    after = [m.afz for m in bench.fake.took(STREAM)][2:]
    assert after == pytest.approx([0.5] * len(after))


def test_one_that_does_not_rise_by_acceleration_is_refused_and_rests():
    bench = standing("px4")
    bench.fake.is_heavy = True
    with pytest.raises(Refused, match="armed, it has not left the ground"):
        bench.arm(command=pushed(0.5))
    assert bench.now / NS == pytest.approx(16.0, abs=0.1)
    assert bench.fake.took(STREAM)[-1].afz == pytest.approx(-4.0)
    bench.run(2.0, RESTING)
    assert not bench.fake.armed


def taking_off() -> Bench:
    """ArduPilot by acceleration, on its way up by its own take-off, in the tick in which it
    obeys."""
    bench = standing("ardupilot")
    assert bench.arm(command=pushed(-1.0))
    return bench


def test_no_downward_acceleration_ends_a_take_off():
    bench = taking_off()
    bench.run(4.5, pushed(-1.0))
    assert bench.fake.took(STREAM) == []
    bench.run(0.5, pushed(0.2))
    assert {round(m.afz, 3) for m in bench.fake.took(STREAM)} == {-0.2}
    bench.fake.sent.clear()
    bench.run(0.5, pushed(-1.0))
    assert bench.fake.took(STREAM)[-1].afz == pytest.approx(1.0)


def test_downward_accelerations_are_kept_back_for_five_seconds_at_most():
    bench = taking_off()
    bench.run(5.5, pushed(-1.0))
    assert bench.fake.took(STREAM)[-1].afz == pytest.approx(1.0)


vectors = st.tuples(*(st.floats(-3.0, 3.0),) * 3)
times = st.floats(0.0, 1.0)
STOPPED = Setpoint(SetpointKind.POSITION, (1.0, 2.0, 3.0), ZERO, ZERO, ZERO, 0.5)


def extrapolated(setpoint, time, kind=CommandKind.POSITION):
    return compensated(at(ZERO)._replace(setpoint=setpoint, kind=kind), Latency(time, 0.3)).setpoint


def on_cubic(p, v, a, j, t):
    """A point of a motion with constant jerk, by the book."""
    place = tuple(
        p0 + v0 * t + a0 * t**2 / 2 + j0 * t**3 / 6
        for p0, v0, a0, j0 in zip(p, v, a, j, strict=True)
    )
    speed = tuple(v0 + a0 * t + j0 * t**2 / 2 for v0, a0, j0 in zip(v, a, j, strict=True))
    return place, speed, tuple(a0 + j0 * t for a0, j0 in zip(a, j, strict=True))


@given(vectors, vectors, vectors, vectors, times)
def test_it_is_the_set_point_of_that_much_later(p, v, a, j, time):
    ahead = extrapolated(Setpoint(SetpointKind.POSITION, p, v, a, j, 0.5, 0.2), time)
    place, speed, acceleration = on_cubic(p, v, a, j, time)
    assert pytest.approx(place, abs=1e-9) == ahead.position
    assert pytest.approx(speed, abs=1e-9) == ahead.velocity
    assert pytest.approx(acceleration, abs=1e-9) == ahead.acceleration
    assert (ahead.jerk, ahead.heading, ahead.heading_rate) == (j, 0.5, 0.2)


@given(times)
def test_one_that_rests_stays_where_it_is(time):
    assert extrapolated(STOPPED, time) == STOPPED


def test_without_a_jerk_its_acceleration_lasts():
    moving = STOPPED._replace(velocity=(1.0, 0.0, 0.0), acceleration=(0.0, 2.0, 0.0), jerk=None)
    ahead = extrapolated(moving, 0.5)
    assert ahead.position == pytest.approx((1.5, 2.25, 3.0))
    assert ahead.velocity == pytest.approx((1.0, 1.0, 0.0))
    assert ahead.acceleration == (0.0, 2.0, 0.0)


def test_one_of_velocity_has_no_place_to_move():
    speed = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    ahead = extrapolated(speed, 0.2, CommandKind.VELOCITY)
    assert ahead.position is None
    assert ahead.velocity == pytest.approx((1.1, 0.0, 0.0))


def test_what_says_not_how_it_moves_is_sent_as_it_is():
    for command in (RESTING, at((1.0, 2.0, 3.0))):
        assert compensated(command, Latency(0.3, 0.3)) is command


def test_an_acceleration_alone_comes_later_by_a_time_of_its_own():
    pushed = Setpoint(SetpointKind.ACCELERATION, None, None, (0.5, 0.0, 0.1), (1.0, -2.0, 0.0))
    ahead = extrapolated(pushed, 0.7, CommandKind.ACCELERATION)
    assert ahead.acceleration == pytest.approx((0.8, -0.6, 0.1))
    assert ahead == pushed._replace(acceleration=ahead.acceleration)


def test_an_acceleration_without_a_jerk_lasts():
    pushed = Setpoint(SetpointKind.ACCELERATION, None, None, (0.5, 0.0, 0.1))
    assert extrapolated(pushed, 0.7, CommandKind.ACCELERATION) == pushed
