"""Every fault on a bare rig: what it breaks, that its end undoes it exactly, that two compose."""

from __future__ import annotations

import math
import random
import statistics

import pytest

from kybflow.core.geometry import LEVEL, ZERO, distance, heading_of, tilt_of
from kybflow.core.signals import NS, Battery, Frame, Imu, Pose
from kybflow.parts import ActiveFaults, Effect
from kybflow.parts.catalog import load_catalog
from kybflow.world.cameras import Weakness

POSE = Pose(0, (1.0, 2.0, 3.0), LEVEL)
BATTERY = Battery(0, 0.5, 14.0)
IMU = Imu(0, 0.004, (0.0, 0.0, 9.81), ZERO)
SIMPLE = {
    "mocap_dropout": {},
    "mocap_noise": {},
    "mocap_swap": {"other": "b"},
    "gust": {"velocity": (1.0, 0.0, 0.0)},
    "wind": {"velocity": (1.0, 0.0, 0.0)},
    "push": {"acceleration": (0.5, 0.0, 0.0)},
    "battery_sag": {},
    "mass_change": {"factor": 1.2},
    "rotor_weak": {},
    "imu_bias_step": {"gyro": (0.1, 0.0, 0.0)},
    "clock_late": {},
    "mocap_frozen": {},
    "mocap_frame": {"turned": 1.0},
    "mocap_jump": {},
    "camera_lost": {},
    "camera_frozen": {},
    "camera_shifted": {},
    "camera_swapped": {"other": "b"},
    "camera_dark": {},
    "camera_blur": {},
    "tags_covered": {},
    "estimator_killed": {"estimator": "mocap"},
    "link_cut": {},
}


def effects_of(name: str, seed: int = 1, **params) -> dict[str, Effect]:
    spec = load_catalog().get("faults", name)
    return dict(spec.cls(spec.params(**params), random.Random(seed)).effects("a"))


def effect_of(name: str, seed: int = 1, **params) -> Effect:
    return effects_of(name, seed, **params)["a"]


def rig_of(*effects: Effect) -> ActiveFaults:
    """A rig on which these effects have begun."""
    rig = ActiveFaults("a")
    for effect in effects:
        rig.begin(effect, 0)
    return rig


def state(rig: ActiveFaults, now: int = 10 * NS):
    """Everything that a simulator obeys."""
    return (
        len(rig.filters), rig.blows, rig.wind(now), rig.push, rig.mass, rig.payload, rig.rotors,
        rig.sag, rig.gyro_bias, rig.accelerometer_bias, rig.late, rig.body,
        rig.camera, rig.view, rig.estimators, rig.deaf, rig.mute,
    )  # fmt: skip


def passed(rig: ActiveFaults, measurement):
    for change in rig.filters:
        measurement = None if measurement is None else change(measurement)
    return measurement


def test_every_fault_of_the_catalog_is_here() -> None:
    assert set(SIMPLE) <= set(load_catalog().names("faults"))
    assert len(SIMPLE) == 23


@pytest.mark.parametrize("name", SIMPLE)
def test_its_end_undoes_it_exactly_also_in_the_middle_of_others(name: str) -> None:
    rig, whole = ActiveFaults("a"), state(ActiveFaults("a"))
    first, second = effect_of(name, **SIMPLE[name]), effect_of(name, **SIMPLE[name])
    rig.begin(first, 0)
    alone = state(rig)
    assert alone != whole
    rig.begin(second, NS)
    rig.end(first)
    assert state(rig) == alone
    rig.end(second)
    assert state(rig) == whole


def test_a_rig_says_when_it_changed() -> None:
    told: list[int] = []
    rig = ActiveFaults("a", lambda: told.append(1))
    effect = Effect(mass=1.1)
    rig.begin(effect, 0)
    rig.end(effect)
    assert len(told) == 2


def test_overlapping_effects_compose() -> None:
    rig = rig_of(effect_of("mass_change", factor=1.1), effect_of("mass_change", added=0.05))
    rig.begin(effect_of("rotor_weak", left=0.8), 0)
    rig.begin(effect_of("rotor_weak", left=0.5, rotor="rear_right"), 0)
    rig.begin(effect_of("clock_late", by=0.02), 0)
    rig.begin(effect_of("clock_late", by=0.03), 0)
    rig.begin(effect_of("gust", velocity=(1.0, 0.0, 0.0)), 0)
    rig.begin(effect_of("wind", velocity=(0.0, 2.0, 0.0)), 0)
    rig.begin(effect_of("push", acceleration=(0.5, 0.0, 0.0)), 0)
    rig.begin(effect_of("push", acceleration=(0.0, 0.0, -0.3)), 0)
    assert (rig.mass, rig.payload) == (1.1, 0.05)
    assert rig.rotors == (0.8, 1.0, 0.5, 1.0)
    assert rig.late == pytest.approx(0.05)
    assert rig.wind(10 * NS) == (1.0, 2.0, 0.0)
    assert rig.push == (0.5, 0.0, -0.3)


def test_mocap_dropout_loses_poses_and_nothing_else() -> None:
    rig = rig_of(effect_of("mocap_dropout"))
    assert [passed(rig, m) for m in (POSE, BATTERY, IMU)] == [None, BATTERY, IMU]


def test_mocap_dropout_loses_an_object_instead() -> None:
    assert effects_of("mocap_dropout", object="cart").keys() == {"cart"}


def test_mocap_dropout_loses_a_share() -> None:
    rig = rig_of(effect_of("mocap_dropout", share=0.25))
    kept = sum(passed(rig, POSE) is not None for _ in range(2000))
    assert kept == pytest.approx(1500, abs=60)


def test_mocap_noise_shakes_poses_by_its_deviations() -> None:
    rig = rig_of(effect_of("mocap_noise", position=0.05, attitude=0.02))
    poses = [passed(rig, POSE) for _ in range(2000)]
    assert statistics.stdev(p.position[1] for p in poses) == pytest.approx(0.05, rel=0.1)
    assert statistics.mean(p.position[1] for p in poses) == pytest.approx(2.0, abs=0.005)
    assert statistics.mean(tilt_of(p.attitude) for p in poses) == pytest.approx(0.025, rel=0.1)
    assert passed(rig, BATTERY) is BATTERY


def test_chance_comes_from_the_generator_that_is_given() -> None:
    def shaken(seed):
        rig = rig_of(effect_of("mocap_noise", seed))
        return [passed(rig, POSE) for _ in range(3)]

    assert shaken(1) == shaken(1)
    assert shaken(1) != shaken(2)
    assert distance(shaken(1)[0].position, POSE.position) < 0.2


def test_mocap_frozen_keeps_the_first_pose_and_gives_it_the_times_of_the_others() -> None:
    rig = rig_of(effect_of("mocap_frozen"))
    poses = [Pose(i, (0.1 * i, 0.0, 1.0), LEVEL) for i in range(3)]
    assert [passed(rig, pose) for pose in poses] == [Pose(i, *poses[0][1:]) for i in range(3)]
    assert passed(rig, BATTERY) is BATTERY


def test_what_repeats_repeats_the_noise_too() -> None:
    rig = rig_of(
        effect_of("mocap_frozen"),
        effect_of("mocap_noise"),
    )
    first, *later = (passed(rig, POSE._replace(time=i)) for i in range(5))
    assert first.position != POSE.position
    assert {pose.position for pose in later} == {first.position}


def test_mocap_jump_moves_poses_by_its_offset() -> None:
    rig = rig_of(
        effect_of("mocap_jump"),
        effect_of("mocap_jump", offset=(0.0, -2.0, 0.5)),
    )
    assert passed(rig, POSE) == POSE._replace(position=(2.0, 0.0, 3.5))
    assert passed(rig, IMU) is IMU


@pytest.mark.parametrize(
    ("given", "position", "turn"),
    [
        ({"factor": 0.001}, (0.001, 0.002, 0.003), (0.1, 0.2, 0.3)),
        ({"mirrored": "y"}, (1.0, -2.0, 3.0), (-0.1, 0.2, -0.3)),
        ({"exchanged": "xy"}, (2.0, 1.0, 3.0), (-0.2, -0.1, -0.3)),
        ({"exchanged": "yz", "mirrored": "y"}, (1.0, -3.0, 2.0), (0.1, -0.3, 0.2)),
    ],
)
def test_mocap_frame_gives_poses_in_other_axes(given, position, turn) -> None:
    """Rotations turn with the axes, and the other way round where one axis is mirrored."""
    rig, w = rig_of(effect_of("mocap_frame", **given)), 0.9273618495495703
    pose = passed(rig, POSE._replace(attitude=(w, 0.1, 0.2, 0.3)))
    assert pose.position == pytest.approx(position)
    assert pose.attitude == pytest.approx((w, *turn))
    assert passed(rig, IMU) is IMU


def test_mocap_frame_turns_the_body_and_no_position() -> None:
    pose = passed(rig_of(effect_of("mocap_frame", turned=math.pi / 2)), POSE)
    assert pose.position == POSE.position
    assert heading_of(pose.attitude) == pytest.approx(math.pi / 2)


def test_camera_lost_loses_frames_and_nothing_else() -> None:
    rig = rig_of(effect_of("camera_lost"))
    assert [passed(rig, m) for m in (Frame(0, "down", None), POSE)] == [None, POSE]


def test_camera_frozen_keeps_the_first_image_of_each_camera() -> None:
    rig = rig_of(effect_of("camera_frozen"))
    frames = [Frame(i, "down" if i % 2 else "front", i) for i in range(4)]
    kept = [passed(rig, frame) for frame in frames]
    assert [(f.time, f.image) for f in kept] == [(0, 0), (1, 1), (2, 0), (3, 1)]
    assert passed(rig, POSE) is POSE


def test_what_is_wrong_with_cameras_adds_up() -> None:
    rig = rig_of(
        effect_of("tags_covered", share=0.25),
        effect_of("tags_covered", share=0.5),
        effect_of("camera_blur", pixels=3.0),
        effect_of("camera_blur", pixels=4.0),
        effect_of("camera_shifted", offset=(0.0, 1.0, 0.0)),
        effect_of("camera_shifted"),
    )
    assert rig.camera == Weakness(0.75, 5.0, False, (1.0, 1.0, 0.0))
    rig.begin(effect_of("camera_dark"), 0)
    assert rig.camera.dark


@pytest.mark.parametrize(("name", "what"), [("camera_swapped", "view"), ("mocap_swap", "body")])
def test_a_swap_exchanges_two(name: str, what: str) -> None:
    effects = effects_of(name, other="b")
    assert {vehicle: getattr(e, what) for vehicle, e in effects.items()} == {"a": "b", "b": "a"}


@pytest.mark.parametrize(("name", "rise"), [("gust", 0.5), ("wind", 3.0)])
def test_wind_rises_smoothly_from_when_it_began(name: str, rise: float) -> None:
    rig = ActiveFaults("a")
    began = 5 * NS
    rig.begin(effect_of(name, velocity=(2.0, -1.0, 0.5), rise=rise), began)
    speeds = [rig.wind(began + round(share * rise * NS))[0] for share in (0.0, 0.25, 0.5, 1.0, 9.0)]
    assert speeds == pytest.approx([0.0, 0.207, 1.0, 2.0, 2.0], abs=1e-3)
    assert rig.wind(began + 10 * NS) == (2.0, -1.0, 0.5)


def test_a_gust_may_set_in_at_once() -> None:
    rig = rig_of(effect_of("gust", velocity=(1.0, 0.0, 0.0), rise=0.0))
    assert rig.wind(0) == (1.0, 0.0, 0.0)


def test_what_is_wrong_with_battery_rotor_and_imu() -> None:
    rig = rig_of(
        effect_of("battery_sag", by=0.4),
        effect_of("rotor_weak", rotor="front_right", left=0.9),
        effect_of("imu_bias_step", accelerometer=(0.0, 0.0, 0.3)),
        effect_of("imu_bias_step", gyro=(0.1, 0.0, 0.0)),
    )
    assert rig.sag == 0.4
    assert rig.rotors == (1.0, 1.0, 1.0, 0.9)
    assert (rig.gyro_bias, rig.accelerometer_bias) == ((0.1, 0.0, 0.0), (0.0, 0.0, 0.3))


@pytest.mark.parametrize(
    ("way", "cut"),
    [("both", (True, True)), ("to_vehicle", (False, True)), ("from_vehicle", (True, False))],
)
def test_link_cut_cuts_both_ways_or_one(way: str, cut: tuple[bool, bool]) -> None:
    rig = rig_of(effect_of("link_cut", way=way))
    assert (rig.deaf, rig.mute) == cut
