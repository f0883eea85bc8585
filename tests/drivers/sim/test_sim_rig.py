"""What a rig breaks of a simulated vehicle, and that nothing is left of it when it is mended."""

from __future__ import annotations

import pytest
from sim_worlds import FRAME, PERIOD, QUIET, in_flight, lift, push, seat, thrust, world

from kybflow.core.geometry import ZERO, distance, norm
from kybflow.core.signals import NS, Battery, Imu, Pose
from kybflow.drivers.sim import SimParams
from kybflow.parts import Effect

HOVER = FRAME.mass * 9.81


def poses(measured):
    return [m for m in measured if isinstance(m, Pose)]


def test_what_is_broken_and_mended_at_once_leaves_no_trace():
    def flight(breaks):
        session, link, now = in_flight(SimParams(gust=0.5), seconds=2.0)
        every = Effect(
            filter=lambda m: None, wind=lambda t: (3.0, 0.0, 0.0), push=(1.0, 2.0, 3.0), mass=2.0,
            payload=0.3, sag=0.5, rotors=(0.1, 1.0, 1.0, 1.0), gyro_bias=(1.0, 0.0, 0.0), late=0.1,
            accelerometer_bias=(0.0, 0.0, 5.0),
        )  # fmt: skip
        if breaks:
            link.faults.begin(every, now)
            link.faults.end(every)
        measured, _ = push(session, link, 1.0, thrust(11.0), now)
        return measured, link.truth()

    assert flight(True) == flight(False)


def test_a_filter_changes_or_drops_what_arrives():
    session, link, now = in_flight()
    lose = Effect(filter=lambda m: None if isinstance(m, Pose) else m)
    link.faults.begin(lose, now)
    measured, now = push(session, link, 0.5, thrust(HOVER), now)
    assert poses(measured) == []
    assert any(isinstance(m, Battery) for m in measured)
    link.faults.end(lose)
    assert len(poses(push(session, link, 0.5, thrust(HOVER), now)[0])) == pytest.approx(60, abs=2)


def test_wind_of_a_rig_pushes_as_long_as_it_blows():
    session, link, now = in_flight()
    blow = Effect(wind=lambda elapsed: (2.0, 0.0, 0.0))
    link.faults.begin(blow, now)
    now = lift(session, link, 1.5, 1.0, now)
    pushed = link.truth().velocity[0]
    assert pushed == pytest.approx(2.0 * FRAME.drag, rel=0.2)
    link.faults.end(blow)
    lift(session, link, 1.5, 1.0, now)
    assert link.truth().velocity[0] < pushed


def test_a_push_gives_the_body_its_acceleration_and_is_gone_when_it_ends():
    session, link, now = in_flight()
    was = link.truth().velocity[1]
    pull = Effect(push=(0.0, 0.5, 0.0))
    link.faults.begin(pull, now)
    now = lift(session, link, 1.5, 0.4, now)
    pushed = link.truth().velocity[1]
    assert pushed - was == pytest.approx(0.4 * 0.5, rel=0.1)
    link.faults.end(pull)
    lift(session, link, 1.5, 0.4, now)
    assert 0.8 * pushed < link.truth().velocity[1] < pushed


def test_a_parcel_is_felt_in_weight_and_inertia_and_is_gone_when_dropped():
    session, link, now = in_flight()
    built = session.model.body_mass[1], tuple(session.model.body_inertia[1])
    _, now = push(session, link, 0.5, thrust(HOVER), now)
    before = link.truth().velocity[2]
    _, now = push(session, link, 0.1, thrust(HOVER), now)
    between = link.truth().velocity[2]
    parcel = Effect(mass=1.1, payload=0.105)
    link.faults.begin(parcel, now)
    _, now = push(session, link, 0.1, thrust(HOVER), now)
    assert session.model.body_mass[1] == pytest.approx(1.2 * built[0])
    assert tuple(session.model.body_inertia[1]) == pytest.approx([1.2 * j for j in built[1]])
    more = (link.truth().velocity[2] - between - (between - before)) / 0.1
    assert more == pytest.approx(9.81 * (1.0 / 1.2 - 1.0), rel=0.1)
    link.faults.end(parcel)
    assert (session.model.body_mass[1], tuple(session.model.body_inertia[1])) == built


def test_a_weak_rotor_tilts_towards_itself():
    session, link, now = in_flight()
    link.faults.begin(Effect(rotors=(0.8, 1.0, 1.0, 1.0)), now)
    session.advance(now + NS // 5)
    turn = link.truth().angular_velocity
    assert norm(turn) > 0.05
    lift(session, link, 1.5, 3.0, now + NS // 5)
    assert link.truth().position[2] > 0.8


def test_a_battery_that_sags_reports_less_and_gives_less_at_once():
    session, link, now = in_flight()
    measured, now = push(session, link, 0.2, thrust(HOVER), now)
    before = [m for m in measured if isinstance(m, Battery)][-1]
    gain = session.onboard.thrusts[0][0]
    sag = Effect(sag=0.4)
    link.faults.begin(sag, now)
    measured, now = push(session, link, 0.3, thrust(HOVER), now)
    after = [m for m in measured if isinstance(m, Battery)][-1]
    assert after.remaining == pytest.approx(before.remaining - 0.4, abs=0.01)
    assert after.voltage < before.voltage - 0.5
    assert session.onboard.thrusts[0][0] == pytest.approx(gain * 0.92**2, rel=0.02)
    link.faults.end(sag)
    measured, _ = push(session, link, 0.3, thrust(HOVER), now)
    after = [m for m in measured if isinstance(m, Battery)][-1]
    assert after.remaining == pytest.approx(before.remaining, abs=0.01)


def test_a_bias_of_the_imu_is_felt_by_who_listens_and_by_the_controller():
    session, link, now = in_flight()
    link.subscribe(frozenset({Imu}))
    link.faults.begin(Effect(gyro_bias=(0.0, 0.0, 0.1), accelerometer_bias=(0.0, 0.0, 0.5)), now)
    measured, now = push(session, link, 0.1, thrust(HOVER), now)
    felt = [m for m in measured if isinstance(m, Imu)]
    assert felt[1].angular_velocity[2] == pytest.approx(0.1, abs=0.02)
    assert felt[1].specific_force[2] == pytest.approx(9.81 + 0.5, abs=0.2)
    push(session, link, 1.0, thrust(HOVER, heading=None), now)
    assert link.truth().angular_velocity[2] == pytest.approx(-0.1, abs=0.03)


def test_late_commands_take_effect_late_and_the_newest_counts():
    def reaction(late):
        session, link, now = in_flight()
        link.faults.begin(Effect(late=late), now)
        _, now = push(session, link, 0.1, thrust(HOVER), now)
        before = session.onboard.controls[0][0]
        for i in range(50):
            link.send(thrust(16.0), now)
            now += PERIOD
            session.advance(now)
            if session.onboard.controls[0][0] > 1.2 * before:
                return i * PERIOD / NS
        return None

    assert reaction(0.0) < 0.009
    assert reaction(0.06) == pytest.approx(0.06, abs=0.009)


def test_commands_so_late_that_none_arrives_wake_the_watchdog():
    session, link, now = in_flight()
    link.faults.begin(Effect(late=0.4), now)
    now = lift(session, link, 1.5, 8.0, now)
    assert link.truth().position[2] == pytest.approx(0.0, abs=0.02)


def test_motion_capture_takes_one_vehicle_for_another():
    session = world(seat(), seat("b", (2.0, 0.0, 0.0)))
    a, b = session.links["a"], session.links["b"]
    swap = Effect(body="b")
    a.faults.begin(swap, 0)
    session.advance(NS // 2)
    assert distance(poses(a.read(NS // 2))[-1].position, (2.0, 0.0, 0.0)) < 0.01
    assert distance(poses(b.read(NS // 2))[-1].position, (2.0, 0.0, 0.0)) < 0.01
    a.faults.end(swap)
    session.advance(NS)
    assert distance(poses(a.read(NS))[-1].position, ZERO) < 0.01


def test_what_is_broken_on_one_vehicle_leaves_the_other_alone():
    def other(breaks):
        session = world(seat(params=SimParams()), seat("b", (5.0, 0.0, 0.0), SimParams()))
        a, b = session.links["a"], session.links["b"]
        if breaks:
            a.faults.begin(Effect(wind=lambda t: (1.0, 0.0, 0.0), mass=1.2, sag=0.3, late=0.02), 0)
        b.send(thrust(12.0), 0)
        return [pose.position for pose in poses(push(session, b, 1.0, thrust(12.0))[0])]

    for broken, whole in zip(other(True), other(False), strict=True):
        assert broken == pytest.approx(whole, abs=1e-6)


def test_quiet_vehicles_of_these_tests_have_nothing_broken():
    rig = world().links["a"].faults
    assert (rig.mass, rig.late, rig.sag, rig.body, rig.filters) == (1.0, 0.0, 0.0, "a", ())
    assert QUIET.watchdog


def test_cameras_see_from_the_place_of_the_vehicle_that_the_rig_says():
    session = world(seat("a"), seat("b", at=(1.0, 2.0, 0.0)))
    one, two = session.links["a"], session.links["b"]
    assert one.view() == one.truth() != two.truth()
    swapped = Effect(view="b")
    one.faults.begin(swapped, 0)
    assert one.view() == two.truth() == two.view()
    one.faults.end(swapped)
    assert one.view() == one.truth()
