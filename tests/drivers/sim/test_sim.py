"""The simulator keeps its promises: honest physics, honest sensors, the same bytes for a seed."""

from __future__ import annotations

import statistics
import subprocess
import sys
from dataclasses import replace
from math import exp

import numpy
import pytest
from sim_worlds import FRAME, PERIOD, QUIET, lift, opened, push, seat, thrust, world

from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL, ZERO, from_euler, from_heading, heading_of, tilt_of
from kybflow.core.signals import NS, Battery, Command, CommandKind, Imu, Pose, Position
from kybflow.drivers.sim import Sim, SimParams
from kybflow.drivers.sim.lab import build
from kybflow.drivers.sim.world import Viewer


def test_importing_the_part_loads_neither_mujoco_nor_numpy():
    code = "import sys, kybflow.drivers.sim; print({'mujoco', 'numpy'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"


def test_the_part_says_what_it_takes_gives_and_steps_at():
    assert Sim.simulated
    assert {CommandKind.ATTITUDE_THRUST} == Sim.accepts
    ours = (Pose, Battery, Imu)
    assert Sim.provides == {*ours, Position}
    assert Sim.step_rate(SimParams(physics=400.0)) == 400.0


def test_it_stands_still_on_the_floor_with_its_rotors_stopped():
    session = world(seat(at=(1.0, 2.0, 0.0), heading=0.5))
    push(session, session.links["a"], 1.0, Command(LEVEL, 0.0, ZERO, 0.5, armed=False))
    state = session.links["a"].truth()
    assert state.position == pytest.approx((1.0, 2.0, 0.0), abs=1e-3)
    assert heading_of(state.attitude) == pytest.approx(0.5, abs=1e-3)


def test_it_stands_on_a_stand_where_it_starts_above_the_floor():
    session = world(seat(at=(0.0, 0.0, 0.6)))
    push(session, session.links["a"], 1.0, Command(LEVEL, 0.0, ZERO, 0.0, armed=False))
    assert session.links["a"].truth().position == pytest.approx((0.0, 0.0, 0.6), abs=1e-3)


def test_hover_holds_level_on_an_imu_with_noise_and_bias():
    session = world(seat(params=SimParams()))
    lift(session, session.links["a"], seconds=8.0)
    state = session.links["a"].truth()
    assert state.position[2] == pytest.approx(2.0, abs=0.4)
    assert abs(state.velocity[2]) < 0.05
    assert tilt_of(state.attitude) < 0.035


def test_an_attitude_command_is_followed_without_seeing_the_truth():
    session, link = opened()
    now = lift(session, link)
    push(session, link, 0.5, thrust(11.5, from_euler(0.1, 0.0, 0.0)), now)
    assert tilt_of(link.truth().attitude) == pytest.approx(0.1, abs=0.02)
    assert link.truth().velocity[1] < -0.2


def test_heading_comes_from_the_command_because_an_imu_cannot_see_it():
    session, link = opened()
    now = lift(session, link)
    for _ in range(500):
        link.send(thrust(11.0, heading=heading_of(link.truth().attitude) + 0.2), now)
        now += PERIOD
        session.advance(now)
    assert heading_of(link.truth().attitude) == pytest.approx(-0.2, abs=0.05)


def test_a_sender_that_knows_no_heading_leaves_the_one_that_is_flown():
    session, link = opened(seat(heading=2.0))
    _, now = push(session, link, 3.0, thrust(11.5, from_heading(2.0), 2.0))
    push(session, link, 3.0, thrust(10.9, from_euler(0.05, 0.0, 0.0), None), now)
    assert heading_of(link.truth().attitude) == pytest.approx(2.0, abs=0.05)
    assert tilt_of(link.truth().attitude) == pytest.approx(0.05, abs=0.02)
    assert link.truth().position[2] > 0.5


def test_a_bias_of_the_gyroscope_is_felt_and_learnt():
    def yaw_after(params, seconds):
        session, link = opened(seat(params=params), seed=3)
        now = lift(session, link)
        for _ in range(round(seconds * 250)):
            link.send(thrust(10.9, heading=None), now)
            now += PERIOD
            session.advance(now)
        return heading_of(link.truth().attitude)

    assert abs(yaw_after(QUIET, 3.0)) < 1e-3
    assert abs(yaw_after(replace(QUIET, gyro_bias=0.02), 3.0)) > 5e-3


def test_the_same_seed_gives_the_same_bytes_and_another_does_not():
    def flight(seed):
        session = world(seat(params=SimParams(gust=0.5)), seed=seed)
        measured, _ = push(session, session.links["a"], 1.0, thrust(12.0))
        return measured, session.links["a"].truth()

    assert flight(7) == flight(7)
    assert flight(7) != flight(8)


def test_how_far_the_engine_steps_at_once_does_not_matter():
    def flight(period):
        session, link = opened(seat(params=SimParams()))
        link.send(thrust(12.0), 0)
        for now in range(period, NS + 1, period):
            session.advance(now)
        return link.truth(), list(link.read(NS))

    assert flight(NS // 250) == flight(NS // 50)


def test_another_vehicle_far_away_changes_neither_noise_nor_flight():
    alone = world(seat(params=SimParams()))
    pair = world(seat(params=SimParams()), seat("b", (5.0, 0.0, 0.0), SimParams()))
    first, second = (push(w, w.links["a"], 1.0, thrust(13.0))[0] for w in (alone, pair))
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        if isinstance(one, Pose):
            assert one.position == pytest.approx(other.position, abs=1e-6)


def test_mocap_has_its_own_rate_latency_and_noise():
    params = replace(QUIET, mocap_position_noise=0.002, mocap_attitude_noise=0.01)
    session, link = opened(seat(params=params))
    poses, now = [], 0
    for _ in range(250 * 8):
        now += PERIOD
        session.advance(now)
        for m in link.read(now):
            if isinstance(m, Pose):
                assert 0.010 <= (now - m.time) / NS < 0.0141
                poses.append(m)
    assert len(poses) == pytest.approx(120 * 8, abs=2)
    assert [p.time for p in poses[:4]] == [0, 8333333, 16666667, 25000000]
    assert statistics.stdev(p.position[0] for p in poses) == pytest.approx(0.002, rel=0.1)
    assert statistics.stdev(2 * p.attitude[1] for p in poses) == pytest.approx(0.01, rel=0.1)
    assert statistics.mean(p.position[1] for p in poses) == pytest.approx(0.0, abs=0.0003)


IMU = frozenset({Imu})


def imus(session, link, seconds, command, start=0):
    measured, now = push(session, link, seconds, command, start)
    return [m for m in measured if isinstance(m, Imu)], now


def test_nobody_is_sent_an_imu_who_has_not_subscribed_to_it():
    session = world()
    assert imus(session, session.links["a"], 0.2, thrust(5.0))[0] == []


def test_an_imu_is_the_average_since_the_last_one():
    session, link = opened(seat(params=replace(QUIET, physics=1000.0)))
    link.subscribe(IMU)
    link.subscribe(frozenset())
    felt, now = imus(session, link, 1.0, Command(LEVEL, 0.0, ZERO, None, armed=False))
    assert [m.time for m in felt] == list(range(PERIOD, now + 1, PERIOD))
    assert {m.dt for m in felt} == {0.004}
    assert felt[-1].specific_force == pytest.approx((0.0, 0.0, 9.81), abs=0.01)
    assert felt[-1].angular_velocity == pytest.approx(ZERO, abs=1e-6)
    assert list(link.read(now)) == []


def test_the_sum_of_what_an_imu_felt_is_the_speed_that_was_gained():
    session, link = opened()
    now = lift(session, link, seconds=3.0)
    link.subscribe(IMU)
    before = link.truth().velocity[2]
    felt, _ = imus(session, link, 0.5, thrust(13.0), now)
    gained = sum((m.specific_force[2] - 9.81) * m.dt for m in felt)
    assert gained > 0.5
    assert gained == pytest.approx(link.truth().velocity[2] - before, abs=0.02)


def test_an_imu_has_the_noise_and_bias_that_the_controller_lives_with():
    params = SimParams(model_error=0.0, gyro_bias=0.01, accelerometer_bias=0.2)
    session, link = opened(seat(params=params), seed=5)
    link.subscribe(IMU)
    felt, _ = imus(session, link, 8.0, Command(LEVEL, 0.0, ZERO, None, armed=False))
    turns = [m.angular_velocity[0] for m in felt[250:]]
    forces = [m.specific_force[1] for m in felt[250:]]
    assert statistics.stdev(turns) == pytest.approx(params.gyro_noise / 2**0.5, rel=0.1)
    assert statistics.stdev(forces) == pytest.approx(params.accelerometer_noise / 2**0.5, rel=0.1)
    assert abs(statistics.mean(turns)) > 1e-3
    assert abs(statistics.mean(forces)) > 0.02


def test_who_listens_to_the_imu_changes_nothing_of_the_flight():
    def flight(kinds):
        session, link = opened(seat(params=SimParams()))
        link.subscribe(kinds)
        push(session, link, 1.0, thrust(12.0))
        return link.truth()

    assert flight(IMU) == flight(frozenset())


def test_a_pose_is_true_at_its_stamp_also_between_two_steps():
    quiet = replace(QUIET, mocap_position_noise=0.0, mocap_attitude_noise=0.0, mocap_latency=0.0)
    session, link = opened(seat(params=quiet))
    link.send(thrust(18.0), 0)
    states, poses = {}, []
    for now in range(NS // 500, NS, NS // 500):
        session.advance(now)
        states[now] = link.truth()
        poses += [m for m in link.read(now) if isinstance(m, Pose)]
    for pose in poses[30:]:
        before = states[pose.time // 2_000_000 * 2_000_000]
        after = (pose.time % 2_000_000) / NS
        height = before.position[2] + after * before.velocity[2]
        assert pose.position[2] == pytest.approx(height, abs=2e-5)


def test_thrust_follows_its_command_with_the_rotors_lag_and_saturates():
    session, link = opened(seat(params=replace(QUIET, battery=1.0)))
    _, now = push(session, link, 0.3, thrust(4.0))
    link.send(thrust(100.0), now)
    session.advance(now + NS // 500 * 10)
    led = session.onboard.rotors[0][0]
    expected = 1.0 - (1.0 - 4.0 / 24.0) * exp(-0.020 / 0.05)
    assert led == pytest.approx(expected, abs=0.03)
    push(session, link, 0.5, thrust(100.0), now + NS // 500 * 10)
    assert max(session.onboard.rotors[0]) <= 1.0


def test_rotor_drag_is_mass_normalised_and_wind_relative():
    def slowing(wind):
        session, link = opened(seat(params=replace(QUIET, wind=wind)))
        now = lift(session, link, seconds=3.0)
        session.data.qvel[:3] = (2.0, 0.0, 0.0)
        push(session, link, 0.1, thrust(10.9), now)
        return (2.0 - link.truth().velocity[0]) / 0.1

    assert slowing(ZERO) == pytest.approx(0.25 * 2.0, rel=0.1)
    assert slowing((-1.0, 0.0, 0.0)) - slowing(ZERO) == pytest.approx(0.25, rel=0.2)


def test_a_hover_that_nobody_holds_drifts_to_the_speed_of_the_wind():
    session = world(seat(params=replace(QUIET, wind=(1.0, 0.5, 0.0))))
    lift(session, session.links["a"], seconds=25.0)
    assert session.links["a"].truth().velocity[:2] == pytest.approx((1.0, 0.5), abs=0.2)


def test_gusts_shake_a_hover():
    def wander(params):
        session = world(seat(params=params))
        lift(session, session.links["a"], seconds=6.0)
        x, y, _ = session.links["a"].truth().velocity
        return abs(x) + abs(y)

    assert wander(QUIET) < 0.01 < wander(replace(QUIET, gust=1.0))


def test_the_battery_empties_in_the_airframes_endurance_and_thrust_sags_with_it():
    frame = replace(FRAME, endurance=60.0)
    session, link = opened(seat(airframe=frame))
    first, now = push(session, link, 0.2, thrust(0.0))
    now = lift(session, link, seconds=12.0, start=now)
    last, now = push(session, link, 0.2, thrust(frame.mass * 9.81 * 1.1), now)
    reports = [[m for m in ms if isinstance(m, Battery)][-1] for ms in (first, last)]
    assert reports[0].remaining > 0.99
    assert 1.0 - reports[1].remaining == pytest.approx(12.0 / 60.0, rel=0.25)
    assert reports[1].voltage < reports[0].voltage - 0.3
    assert session.onboard.thrusts[0][0] < 0.96 * frame.thrust


def test_what_flies_differs_from_what_its_maker_says_within_the_model_error():
    vehicles = [world(seat(params=SimParams()), seed=s).links["a"] for s in range(8)]
    masses = [v.body.mass for v in vehicles]
    assert len(set(masses)) == 8
    assert all(abs(m / FRAME.mass - 1.0) <= 0.05 for m in masses)
    assert all(len(set(v.body.thrust)) == 4 for v in vehicles)
    assert world().links["a"].body.mass == FRAME.mass


@pytest.mark.parametrize("flat", [1.0, 0.91], ids=["a plate", "a quadrotor"])
def test_whatever_is_drawn_is_a_body(flat):
    frame = replace(FRAME, inertia=(0.011, 0.011, 0.022 * flat))
    for seed in range(50):
        drawn = build(frame, 0.2, numpy.random.default_rng(seed)).inertia
        assert 2.0 * max(drawn) <= sum(drawn) * (1.0 + 1e-12)
        assert all(abs(j / i - 1.0) <= 0.2 for j, i in zip(drawn, frame.inertia, strict=True))


def test_a_vehicle_that_runs_into_another_pushes_it():
    session = world(seat(), seat("b", (0.0, 0.45, 0.0)))
    session.data.qpos[[2, 9]] = 1.0
    session.data.qvel[1] = 1.5
    session.advance(NS // 5)
    assert session.links["b"].truth().velocity[1] > 0.3


def test_sixteen_vehicles_share_one_world():
    seats = [seat(f"v{i}", (i % 4 * 2.0, i // 4 * 2.0, 0.0), SimParams()) for i in range(16)]
    session = world(*seats)
    for now in range(PERIOD, NS, PERIOD):
        for link in session.links.values():
            link.send(thrust(13.0), now)
        session.advance(now)
    heights = [link.truth().position[2] for link in session.links.values()]
    assert min(heights) > 0.1
    assert len(set(heights)) == 16


def test_vehicles_that_disagree_about_the_physics_are_refused():
    with pytest.raises(DriverError, match="one physics rate"):
        world(seat(), seat("b", (2.0, 0.0, 0.0), replace(QUIET, physics=1000.0)))


def test_a_diverged_simulation_is_an_error_and_not_a_fresh_start(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = world()
    push(session, session.links["a"], 0.1, thrust(5.0))
    session.data.qvel[:] = 1e12
    with pytest.raises(DriverError, match="diverged"):
        push(session, session.links["a"], 0.1, thrust(5.0), NS // 10)


def test_the_viewer_is_refused_without_a_display(monkeypatch):
    import glfw

    monkeypatch.setattr(glfw, "init", lambda: False)
    with pytest.raises(DriverError, match="display"):
        Viewer(None, None)
