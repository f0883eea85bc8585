"""What a lab and its air do to a simulated vehicle, and that a calm world does nothing of it."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sin, sqrt

import numpy
import pytest
from sim_worlds import FRAME, PERIOD, QUIET, push, seat, thrust, world

from kybflow.core.geometry import LEVEL, ZERO, norm
from kybflow.core.signals import NS, Imu, Pose
from kybflow.core.units import DEG
from kybflow.drivers.sim.lab import Downwash, GroundEffect, Wandering, as_flown
from kybflow.drivers.sim.receiver import Receiver
from kybflow.drivers.sim.sensors import Stamps, draw, vibrations
from kybflow.drivers.sim.steps.onboard import AttitudeController, Loop, smooth
from kybflow.world.vehicle_context import LEGS

LAB = replace(as_flown(QUIET), calm=False)
"""A lab that does nothing to a vehicle but what a test asks for."""
HOVER = FRAME.mass * 9.81


def lab(**facts):
    session = world(seat(params=replace(LAB, **facts)))
    return session, session.links["a"]


def test_a_calm_world_has_nothing_of_a_lab() -> None:
    calm, still = world(seat(params=QUIET)), world(seat(params=LAB))
    for session in (calm, still):
        push(session, session.links["a"], 1.0, thrust(1.1 * HOVER))
    assert calm.truth(0) == still.truth(0)


def test_what_wanders_has_its_deviation_and_forgets_in_its_time() -> None:
    noise = draw(numpy.random.default_rng(1), [0.0, 0.0], [1.0, 1.0])
    process = Wandering((0.08, 2.0), 0.5, noise)
    values = numpy.array([process.after(0.02) for _ in range(100_000)])
    assert values.std(axis=0) == pytest.approx((0.08, 2.0), rel=0.03)
    x = values[:, 0] / 0.08
    assert (x[:-25] * x[25:]).mean() == pytest.approx(numpy.exp(-1.0), abs=0.05)


def test_eddies_push_and_turn_a_vehicle() -> None:
    session, link = lab(force_noise=0.5)
    push(session, link, 3.0, thrust(1.05 * HOVER))
    assert 0.01 < norm((*session.truth(0).velocity[:2], 0.0)) < 5.0
    session, link = lab(torque_noise=2.0)
    push(session, link, 3.0, thrust(1.05 * HOVER))
    assert session.truth(0).attitude != LEVEL


def samples(session, link, newtons):
    """What its IMU measures in each physics step of two seconds, once the rotors turn."""
    link.subscribe(frozenset({Imu}))
    measured = []
    for _ in range(1500):
        link.send(thrust(newtons), session.now)
        session.advance(session.now + NS // 500)
        measured += [m for m in link.read(session.now) if isinstance(m, Imu)]
    return numpy.array([(*m.angular_velocity, *m.specific_force) for m in measured[500:]])


@pytest.mark.parametrize("share", [0.9, 0.45, 0.0])
def test_what_the_imu_feels_of_the_rotors_goes_with_their_thrust(share: float) -> None:
    session, link = lab(accelerometer_vibration=1.0, gyro_vibration=1.0 * DEG)
    felt = samples(session, link, share * HOVER).std(axis=0)
    expected = share * numpy.array((DEG, DEG, DEG, 0.6, 0.6, 1.0))
    assert felt == pytest.approx(expected, rel=0.1, abs=1e-9)
    assert (numpy.std(session.onboard.controls[0]) > 1e-4) == (share > 0.0)


def test_what_an_imu_adds_up_of_the_rotors_stays_small() -> None:
    blocks = vibrations(numpy.random.default_rng(1), [1.0, 0.2])
    shaken = numpy.concatenate([next(blocks) for _ in range(40)])
    assert shaken.std(axis=0) == pytest.approx((1.0, 0.2), rel=0.02)
    assert abs(shaken.cumsum(axis=0)).max(axis=0) == pytest.approx((2.9, 0.6), rel=0.2)


@pytest.mark.parametrize(("inflow", "rises"), [(2.0, 0.5), (0.0, 0.0)])
def test_wind_from_below_lifts_where_rotors_feel_it(inflow: float, rises: float) -> None:
    session, link = lab(inflow=inflow, wind=(0.0, 0.0, 1.0))
    push(session, link, 2.0, thrust(1.3 * HOVER))
    still, other = lab(inflow=inflow)
    push(still, other, 2.0, thrust(1.3 * HOVER))
    gained = session.truth(0).velocity[2] - still.truth(0).velocity[2]
    assert gained == pytest.approx(rises, abs=0.15 if inflow else 1e-9)


def test_a_gyroscopes_filter_halves_the_power_at_its_cut_off() -> None:
    onboard = world().onboard
    AttitudeController(FRAME, Loop(FRAME, cut_off=50.0), 0.0, 0.0005, onboard, 0)
    gyro, passed = onboard.gyros[0], []
    for step in range(4000):
        rate = sin(2.0 * pi * 50.0 * step * 0.0005)
        gyro, (x, _, _) = smooth(gyro, (rate, 0.0, 0.0))
        passed.append(x)
    assert max(passed[2000:]) == pytest.approx(sqrt(0.5), abs=0.02)


def test_controls_reach_the_rotors_after_the_dead_time() -> None:
    session, link = lab(dead_time=0.02)
    prompt, other = lab()
    seen = []
    for _ in range(20):
        for flown, own in ((session, link), (prompt, other)):
            push(flown, own, 0.004, thrust(HOVER), flown.now)
        seen.append((session.onboard.rotors[0][0] > 0.0, prompt.onboard.rotors[0][0] > 0.0))
    assert [late for _, late in seen].index(True) + 5 == [late for late, _ in seen].index(True)


def test_a_fault_that_ends_loses_no_command_that_is_late_by_itself() -> None:
    controller = AttitudeController(FRAME, Loop(FRAME), 0.0, 0.002, world().onboard, 0)
    receiver = Receiver(controller, FRAME, has_watchdog=False)
    receiver.delay(thrust(1.0), 0, NS // 10)
    receiver.set_delay(NS)
    receiver.delay(thrust(2.0), 0, 0)
    receiver.set_delay(0)
    assert receiver.delay(thrust(3.0), NS // 5, 0) == NS // 5
    assert receiver.update(NS // 10) == NS // 5


def test_commands_arrive_late_in_their_order() -> None:
    session, link = lab(command_latency=0.02, command_jitter=0.004)
    begun, now = None, 0
    while begun is None:
        link.send(thrust(HOVER), now)
        now += PERIOD
        session.advance(now)
        begun = now / NS if session.onboard.setpoints[0][0] else None
    assert 0.008 < begun < 0.04


def test_stamps_are_off_and_some_poses_are_lost() -> None:
    stamps = Stamps(0.005, 0.001, 0.02, numpy.random.default_rng(3))
    said = [stamps.of(NS) for _ in range(20_000)]
    late = [stamp - NS for stamp in said if stamp is not None]
    assert 1.0 - len(late) / len(said) == pytest.approx(0.02, abs=0.004)
    assert numpy.mean(late) / NS == pytest.approx(0.005, abs=1e-4)
    assert numpy.std(late) / NS == pytest.approx(0.001, rel=0.03)
    exact = Stamps(0.0, 0.0, 0.0, numpy.random.default_rng(3))
    assert exact.of(123) == 123


def test_motion_capture_takes_another_body_for_the_vehicle() -> None:
    session, link = lab(
        mocap_misalignment=2.0 * DEG, mocap_attitude_noise=0.0, mocap_position_noise=0.0
    )
    measured, _ = push(session, link, 0.1, thrust(0.0))
    turns = {tuple(round(v, 9) for v in m.attitude) for m in measured if isinstance(m, Pose)}
    [(_, x, y, z)] = turns
    assert 0.002 < sqrt(x * x + y * y + z * z) < 0.08


def test_the_on_board_gains_are_those_of_another_airframe() -> None:
    right, wrong = (lab(loop_error=error)[0].onboard.gains[0] for error in (0.0, 0.1))
    assert right != wrong
    assert wrong == pytest.approx(right, rel=0.4)


HOLDS = HOVER / 4.0 / FRAME.thrust
"""The part of each rotor's largest thrust that holds it."""
RADIUS = 0.125
"""Of a rotor of that airframe, a quarter of its 0.5 m."""
INDUCED = sqrt(HOVER / (2.0 * 1.2 * 4.0 * pi * RADIUS**2))
"""What its rotors induce in hover, m/s."""


def hovering(*heights, **facts):
    """Vehicles above each other whose rotors already give what holds them, and the speed along z
    that each has after 40 ms of that."""
    params = replace(LAB, inflow=2.0, **facts)
    names = "abc"[: len(heights)]
    session = world(*(seat(name, (5.0 * i, 0.0, 0.0), params) for i, name in enumerate(names)))
    for link in session.links.values():
        link.send(thrust(HOVER), 0)
    states = session.data.qpos.reshape(len(heights), 7)
    for index, height in enumerate(heights):
        states[index, :3] = (0.0, 0.0, height)
        session.onboard.rotors[index] = session.onboard.controls[index] = (HOLDS,) * 4
        session.onboard.loops[index] = (*ZERO, HOLDS, *ZERO)
    session.apply_faults(0)  # forgets where they stood
    push(session, session.links["a"], 0.04, thrust(HOVER))
    return session, session.data.qvel.reshape(len(heights), 6)[:, 2].tolist()


@pytest.mark.parametrize(
    ("radii", "gain"), [(0.1, 0.430), (0.5, 0.430), (1.0, 0.159), (2.0, 0.0886), (20.0, 0.00185)]
)
def test_thrust_grows_over_the_floor(radii: float, gain: float) -> None:
    """By hand from the equation, over the rotors' radius: d = 2.83, b = 4."""
    ground = GroundEffect(FRAME, 1.0)
    assert ground.gain(radii * RADIUS) == pytest.approx(gain, rel=0.02)
    assert GroundEffect(FRAME, 0.5).gain(RADIUS) == pytest.approx(0.5 * ground.gain(RADIUS))


def test_a_quadrotors_gain_is_more_than_one_rotors_and_less_than_four_in_one_place() -> None:
    for z in numpy.linspace(0.6, 4.0, 20):
        alone, together = (1.0 / (1.0 - (r / 4.0 / z) ** 2) - 1.0 for r in (1.0, 4.0))
        assert alone < GroundEffect(FRAME, 1.0).gain(z * RADIUS) < abs(together)


def test_a_vehicle_in_hover_over_the_floor_rises() -> None:
    height = 2.0 * RADIUS - LEGS
    _, [rises] = hovering(height, ground_effect=1.0)
    _, [stays] = hovering(height)
    assert rises - stays == pytest.approx(0.0886 * 9.81 * 0.04, rel=0.05)


@pytest.mark.parametrize(
    ("depth", "aside", "speed"),
    [
        (2.0, 0.0, 10.11 / 7.817),
        (2.0, 0.07668 * 7.817, 10.11 / 7.817 / 2.0),
        (10.0, 0.0, 10.11 / 15.817),
        (0.0, 0.0, 0.0),
        (-1.0, 0.0, 0.0),
        (0.1, 3.0, 0.0),
    ],
)
def test_air_sinks_below_a_vehicle(depth: float, aside: float, speed: float) -> None:
    """Over what its rotors induce; lengths over its diameter."""
    jet = Downwash(FRAME, 1.0).jet((1.0, 2.0, 3.0), HOVER)
    place = (1.0 + 0.5 * aside * 0.6, 2.0 - 0.5 * aside * 0.8, 3.0 - 0.5 * depth)
    assert jet.sinks(place) == pytest.approx(speed * INDUCED, abs=1e-9)


def test_a_heavier_vehicle_blows_harder() -> None:
    light, heavy = (Downwash(FRAME, 1.0).jet(ZERO, n * HOVER) for n in (1.0, 4.0))
    assert heavy.sinks((0.0, 0.0, -1.0)) == pytest.approx(2.0 * light.sinks((0.0, 0.0, -1.0)))


def test_a_vehicle_below_another_is_pushed_down_and_more_below_two() -> None:
    _, still = hovering(4.0, 3.0, 2.0)
    session, speeds = hovering(4.0, 3.0, 2.0, downwash=1.0)
    lost = [before - now for before, now in zip(still, speeds, strict=True)]
    near, far = (10.11 / (5.817 + depth) * INDUCED for depth in (2.0, 4.0))
    sinks = (0.0, near, sqrt(near**2 + far**2))
    expected = [2.0 * FRAME.drag * speed * 0.04 for speed in sinks]
    assert lost == pytest.approx(expected, rel=0.06, abs=1e-9)
    assert [session.onboard.winds[i][2] for i in range(3)] == pytest.approx(
        [-speed for speed in sinks], rel=0.02
    )


def test_neighbours_at_one_height_leave_each_other_in_peace() -> None:
    jet = Downwash(FRAME, 1.0).jet((0.0, 0.0, 1.0), HOVER)
    assert jet.sinks((0.9, 0.0, 0.99)) < 0.005


def test_rotors_at_rest_blow_nothing() -> None:
    assert Downwash(FRAME, 1.0).jet(ZERO, 0.0).sinks((0.0, 0.0, -1.0)) == 0.0
