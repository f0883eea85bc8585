"""The preflight: each line, green and red, with its reason and its mission line."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from math import pi
from types import SimpleNamespace

import numpy
import pytest
from failsafe_parts import alarming
from part_bench import BLOCK
from plans import Bent, bent, part, plan, state, then, vehicle, wrapped
from short_flights import down, named, path, up
from toolchain import MISSIONS, invoke

from kybflow.api.flight import inspect
from kybflow.api.opening import assemble, open_devices
from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL, from_euler, from_heading, multiply, scale
from kybflow.core.signals import NS, Battery, Estimate, Frame, Imu, Pose, Reaction
from kybflow.drivers.sim import Sim
from kybflow.dsl.plan import EstimatorPlan, PartPlan, SensorPlan, TransitionPlan
from kybflow.parts import Estimator, Sensor, Stream
from kybflow.runtime.clock import SimulatedClock
from kybflow.runtime.events import Events
from kybflow.runtime.preflight import PreflightResult, preflight
from kybflow.runtime.scores import Score
from kybflow.runtime.vehicle.touch_down import said_distance
from kybflow.world.cameras import Camera, Lens
from kybflow.world.shapes import Box, MovingSphere


def checks(*vehicles, **facts) -> dict[tuple[str, str], PreflightResult]:
    return {(line.vehicle, line.check): line for line in inspect(plan(*vehicles, **facts)).lines}


def flight(name: str = "a", **more):
    return vehicle(name, [up("down"), down()], at=f"m.yaml:{name}", **more)


def without(kind):
    """Bends measurements so that none of this kind arrives."""
    return lambda measurement, now: None if isinstance(measurement, kind) else measurement


def test_all_is_green_on_a_good_day_and_says_what_it_found():
    found = inspect(plan(flight())).lines
    assert {line.check for line in found} == {
        "link", "watchdog", "pose stream", "battery", "estimate", "start pose", "heading", "frame",
        "fence",
    }  # fmt: skip
    assert all(line.green and line.reason for line in found)


class Heard(Bent):
    """A bent link that also delivers the IMU."""

    def subscribe(self, kinds):
        self.link.subscribe(kinds)


def heard(bend):
    """The preflight of a vehicle whose measurements, the IMU's among them, are bent."""
    return checks(flight(driver=wrapped(lambda _, link: Heard(link, bend))))


def changed(change):
    """The preflight of a vehicle all of whose poses are changed."""
    return heard(lambda m, _: change(m) if isinstance(m, Pose) else m)


def turned(by):
    return lambda pose: pose._replace(attitude=multiply(pose.attitude, by))


def test_a_body_that_is_turned_is_told_with_the_heading_that_it_has():
    line = changed(turned(from_heading(0.5 * pi)))["a", "heading"]
    assert not line.green
    found = float(line.reason.partition(" ")[0])
    assert found == pytest.approx(90.0, abs=4.0)  # the lab's misalignment
    assert line.reason.endswith(f"or write `heading: {found:.0f} deg` in `start`")
    assert line.at == "m.yaml:a"
    assert changed(turned(from_heading(pi / 6)))["a", "heading"].green


def test_a_body_that_is_tilted_against_gravity_is_told():
    line = changed(turned(from_euler(0.35, 0.0, 0.0)))["a", "frame"]
    assert not line.green
    assert float(line.reason.partition(" ")[0]) == pytest.approx(20.0, abs=4.0)
    assert "off gravity (15 deg allowed): redefine" in line.reason
    assert changed(turned(from_euler(0.175, 0.0, 0.0)))["a", "frame"].green


def test_millimetres_that_are_taken_for_metres_waver():
    line = changed(lambda p: p._replace(position=scale(p.position, 1000.0)))["a", "frame"]
    assert not line.green
    assert line.reason.endswith("check the stream's `units`")


@pytest.mark.parametrize("period", [None, 0.1])
def test_without_an_imu_or_with_a_slow_one_it_says_what_it_cannot_judge(period):
    def bend(measurement, now):
        if not isinstance(measurement, Imu):
            return measurement
        return None if period is None else measurement._replace(dt=period)

    line = heard(bend)["a", "frame"]
    assert line.green
    assert "`units` and `axes`" in line.reason
    assert ("not checked" in line.reason) is (period is None)


def test_where_only_positions_are_flown_by_it_says_that_their_frame_is_not_judged():
    fusion = part("estimators", "fusion", source="position")
    line = checks(flight(estimators=(EstimatorPlan(fusion, recover_after=1.0),)))["a", "frame"]
    assert line.green
    assert line.reason.startswith("not judged: positions without an attitude")


@pytest.mark.thorough
def test_a_flight_without_an_imu_raises_no_alarm_about_the_frame(run):
    """The preflight has said that nothing is judged."""
    driver = wrapped(lambda _, link: Heard(link, without(Imu)))
    _, told = run(flight(driver=driver))
    assert named(told, "mocap_frame_wrong") == []
    assert len(named(told, "landed")) == 1


def test_nothing_arms():
    sent = []

    class Watched(Bent):
        def send(self, command, now):
            sent.append(command)

    inspect(plan(flight(driver=wrapped(lambda _, link: Watched(link, lambda m, now: m)))))
    assert sent == []


@pytest.mark.parametrize(
    ("arrives", "heard", "green"),
    [(False, True, False), (True, False, False), (True, True, True)],
    ids=["nothing", "only from the simulator beside it", "from the vehicle"],
)
def test_the_link_is_red_until_the_vehicle_itself_has_delivered(arrives, heard, green):
    def arriving(_, link):
        opened = Bent(link, lambda measurement, _: measurement)
        opened.read = lambda now: [Battery(now, 0.9, 12.0)] if arrives else []
        opened.is_heard = heard
        return opened

    flown = plan(flight(driver=wrapped(arriving)))
    devices = open_devices(flown, 0)
    try:
        engine = assemble(flown, devices, Events(), SimulatedClock(250), Score(flown))
        [own] = engine.vehicles
        own.sense(0)
        line = next(preflight(own, [own]))
    finally:
        devices.close()
    reason = "delivered 0 ms ago" if green else "no measurement has arrived yet"
    assert (line.check, line.green, line.reason) == ("link", green, reason)


@pytest.mark.thorough
def test_two_swapped_bodies_are_named():
    class SwappedSim(Sim):
        @classmethod
        def open(cls, seats, generator):
            session = super().open(seats, generator)
            one, two = session.links["a"], session.links["b"]
            session.links = {"a": two, "b": one}
            return session

    driver = replace(part("drivers", "sim"), cls=SwappedSim)
    found = checks(flight("a", driver=driver), flight("b", driver=driver, start=(1.0, 0.0, 0.0)))
    assert found["a", "start pose"] == PreflightResult(
        "a",
        "start pose",
        False,
        "1.00 m from the declared start (0.25 m allowed); the body of `a` stands where `b` should "
        "start",
        "m.yaml:a",
    )


def test_a_stream_that_is_too_slow_is_red():
    def every_third_of_a_second(measurement, now):
        if isinstance(measurement, Pose) and now % (NS // 3) > 2 * 4_000_000:
            return None
        return measurement

    line = checks(flight(driver=bent(every_third_of_a_second)))["a", "pose stream"]
    assert not line.green
    assert line.reason.endswith(" Hz, 4 Hz needed")


def test_a_stream_that_never_comes_is_red():
    found = checks(flight(driver=bent(without(Pose))))
    assert found["a", "pose stream"].reason == "no measurements"
    assert found["a", "estimate"].reason == "no healthy estimate from mocap"


def sensor(read, trouble=lambda: None, kind=Pose, estimator="mocap") -> SensorPlan:
    """A sensor whose stream calls `read` with the time of a tick, and `trouble`."""

    class Calling(Stream):
        def read(self, now):
            return read(now)

        def trouble(self):
            return trouble()

        def close(self): ...

    class Called(Sensor[None]):
        provides = frozenset({kind})

        @classmethod
        def open(cls, params, context, link, generator):
            return Calling()

    return SensorPlan(PartPlan("told", Called, None, "sensors.told", "m.yaml:7"), (estimator,))


def raising(error: Exception):
    def raises(*_):
        raise error

    return raises


WRONG_SIZE = "the frames are 4 x 3, but the lens is for 8 x 6"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("read", "trouble", "reason"),
    [
        (lambda now: (), lambda: None, "no measurements"),
        (lambda now: (), lambda: "no server at lab:3883", "no measurements: no server at lab:3883"),
        (lambda now: (), raising(OSError("gone")), "no measurements: OSError: gone"),
        (raising(DriverError(WRONG_SIZE)), lambda: None, f"no measurements: {WRONG_SIZE}"),
    ],
)
def test_why_a_sensor_gives_nothing_is_said(read, trouble, reason):
    line = checks(flight(sensors=(sensor(read, trouble),)))["a", "pose stream"]
    assert (line.green, line.reason) == (False, reason)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("located", "reason"),
    [
        (False, "no healthy estimate from seeing: frames arrive, but no tag of the map is found"),
        (True, "no healthy estimate from seeing"),
    ],
)
def test_frames_without_a_tag_are_told_from_no_frames(located, reason):
    class Seeing(Estimator[None]):
        needs = frozenset({Frame})

        def update(self, measurements, now):
            frames = [m for m in measurements if isinstance(m, Frame)]
            if frames:
                where = SimpleNamespace(position=(0, 0, 0), views=(), covariance=numpy.eye(6))
                self.sighting = SimpleNamespace(frames=frames, located=where if located else None)

    image = numpy.zeros((4, 4), numpy.uint8)
    film = sensor(lambda now: [Frame(now, "down", image)], kind=Frame, estimator="seeing")
    seeing = EstimatorPlan(PartPlan("seeing", Seeing, None, "estimators.seeing"), recover_after=1.0)
    lens = Lens(4, 4, 4.0, 4.0, 2.0, 2.0)
    one = flight(
        sensors=(film,), estimators=(seeing,), cameras={"down": Camera("down", lens, (0, 0, 0))}
    )
    found = checks(one)
    assert found["a", "frame stream"].green
    line = found["a", "estimate"]
    assert not line.green
    assert line.reason.removesuffix(" in them") == reason


def test_what_was_left_out_of_a_stream_is_said():
    def ahead(measurement, now):
        if isinstance(measurement, Pose):
            return measurement._replace(time=now + NS)
        return measurement

    line = checks(flight(driver=bent(ahead)))["a", "pose stream"]
    assert not line.green
    reason, _, left_out = line.reason.partition("; ")
    assert reason == "no measurements"
    count, _, why = left_out.partition(" ")
    assert int(count) > 100
    assert why == "were left out as implausible"


def positions(up: float):
    """The start of a vehicle on positions alone, whose height is good for so many metres."""
    vague = part("estimators", "fusion", source="position", samples=15)
    driver = part("drivers", "sim", position_noise=0.3, position_noise_up=up)
    estimators = (EstimatorPlan(vague, recover_after=1.0),)
    found = checks(flight(driver=driver, estimators=estimators))
    return found["a", "start pose"]


def test_a_vague_estimate_may_be_further_from_the_start():
    line = positions(0.5)
    assert line.green
    away = float(line.reason.split()[0])
    assert 0.25 < away < 1.2
    assert line.reason.endswith("m from the declared start (1.13 m allowed, 3 times its spread)")


def test_but_not_as_far_as_it_likes():
    estimate = Estimate(0, (0.0, 0.0, 0.0), (0.0,) * 3, LEVEL, (0.0,) * 3, "fusion", 0.0, 1.0)
    spreads = (0.002, 0.083, 0.1, 5.0)
    assert [said_distance(estimate._replace(spread=s)) for s in spreads] == [
        "0.25 m allowed", "0.25 m allowed", "0.30 m allowed, 3 times its spread",
        "2.00 m allowed, the most",
    ]  # fmt: skip


def test_a_vehicle_without_a_battery_report_stays():
    line = checks(flight(driver=bent(without(Battery))))["a", "battery"]
    assert (line.green, line.reason, line.at) == (False, "no report", "m.yaml:9")


def test_a_link_that_falls_silent_is_red():
    def early(measurement, now):
        return measurement if now < NS // 20 else None

    line = checks(flight(driver=bent(early)), fence=Box((1.0, 1.0, 0.0), (2.0, 2.0, 2.0)))
    assert line["a", "link"].green is False
    assert line["a", "link"].reason.startswith("delivered 49")


@pytest.mark.thorough
def test_a_dangerous_watchdog_keeps_it_on_the_ground():
    class Unwatched(Sim):
        @classmethod
        def watchdog(cls, params):
            return "COM_OBL_RC_ACT is 0: it flies on"

    driver = replace(part("drivers", "sim"), cls=Unwatched, at="m.yaml:9")
    line = checks(flight(driver=driver))["a", "watchdog"]
    assert line == PreflightResult(
        "a", "watchdog", False, "COM_OBL_RC_ACT is 0: it flies on", "m.yaml:9"
    )


def test_outside_the_fence_and_inside_an_obstacle_it_stays():
    fence = Box((-2.0, 0.5, 0.0), (2.0, 2.0, 2.5))
    pillar = Box((-0.05, -0.05, 0.0), (0.05, 0.05, 2.0))
    found = checks(flight(), fence=fence, obstacles={"pillar": pillar})
    assert found["a", "fence"].reason == "0.50 m outside"
    assert not found["a", "fence"].green
    assert not found["a", "obstacles"].green
    assert "from `pillar` (0.10 m needed)" in found["a", "obstacles"].reason


@pytest.mark.thorough
def test_below_a_moving_obstacle_it_stays():
    ball = MovingSphere(((0.0, 0.0, 0.5), (0.0, 0.2, 0.5)), 0.2, 0.01)
    found = checks(flight(), moving={"ball": ball})
    assert found["a", "obstacle ball"].green
    assert not found["a", "obstacles"].green
    assert "from `ball` (0.10 m needed)" in found["a", "obstacles"].reason


def test_below_an_object_it_stays():
    block = BLOCK._replace(at=(0.0, 0.0, 0.4))
    found = checks(flight(), objects={"block": block})
    assert not found["a", "obstacles"].green
    assert "from `block` (0.10 m needed)" in found["a", "obstacles"].reason


@pytest.mark.thorough
def test_two_that_would_brake_at_once_stay():
    found = checks(flight("a"), flight("b", start=(0.22, 0.0, 0.0)))
    line = found["a", "supervisors.proximity"]
    assert not line.green
    assert line.reason == "0.22 m from `b`, 0.24 m needed"


@pytest.mark.thorough
def test_what_a_supervisor_foresees_is_said_with_its_mission_line(run):
    always = flight().supervisors
    bad = alarming((0.0, 9.0, Reaction.BRAKE))
    flown, told = run(flight(supervisors=(*always, bad)))
    [failed] = named(told, "preflight_failed")
    assert failed.fields == {"check": "supervisors.alarmed", "reason": "the test says so"}
    assert failed.at == "mission.yaml:7"
    assert named(told, "behavior_started") == []
    assert flown.exit_code == 1


@pytest.mark.thorough
def test_a_second_take_off_asks_where_it_landed(run):
    again = state(
        "again", part("behaviors", "wait_on_ground"), TransitionPlan(target="up2", after=4.0)
    )
    up2 = state("up2", part("behaviors", "take_off", height=0.5), then("end"))
    away = state("away", part("behaviors", "fly_to", position=(1.0, 0.0, 0.6)), then("down"))
    states = [
        up("away"),
        away,
        state("down", part("behaviors", "land"), then("again")),
        again,
        up2,
        state("end", part("behaviors", "land"), then("landed")),
    ]
    plan = vehicle("a", states)
    flown, told = run(plan)
    assert path(told, "a") == ["up", "away", "down", "again", "up2", "end", "landed"]
    assert flown.exit_code == 0
    landed = named(told, "landed")[0].time

    def carried(measurement, now):
        if isinstance(measurement, Pose) and now > landed + NS // 2:
            x, y, z = measurement.position
            return measurement._replace(position=(x - 0.4, y, z))
        return measurement

    flown, told = run(replace(plan, driver=bent(carried)))
    assert path(told, "a") == ["up", "away", "down", "again", "up2", "landed"]
    [failed] = named(told, "behavior_failed")
    assert "m from where the vehicle stood (0.25 m allowed)" in str(failed.fields["reason"])
    assert flown.exit_code == 1


def kybflow(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "kybflow", "preflight", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def test_the_command_prints_a_line_for_each_check(tmp_path):
    done = kybflow(str(MISSIONS / "first_flight.yaml"))
    assert done.returncode == 0
    *lines, rehearsal = done.stdout.splitlines()
    assert all(line.startswith("green  nano  ") and "[" in line for line in lines)
    assert rehearsal.startswith("green  all   rehearsal    ")
    assert len(lines) >= 7
    assert not (tmp_path / "runs").exists()


def test_the_command_says_red_and_invalid(tmp_path):
    mission = (MISSIONS / "first_flight.yaml").read_text(encoding="utf-8")
    mission = mission.replace("import:\n  std: library/", "import:\n  std: kybflow/")
    mission = mission.replace("airframes.yaml", "airframes")
    low = mission.replace("    behaviors:", "    driver: {use: sim, battery: 10 %}\n    behaviors:")
    assert low != mission
    red, bad = tmp_path / "red.yaml", tmp_path / "bad.yaml"
    red.write_text(
        mission + "\ntargets:\n  sim: {all: {driver: {use: sim, battery: 10 %}}}\n", "utf-8"
    )
    bad.write_text(mission.replace("do: hover", "do: hoover"), encoding="utf-8")
    done = invoke("preflight", red)
    assert done.exit_code == 1
    assert "RED    nano  supervisors.battery" in done.output
    assert invoke("preflight", bad).exit_code == 2


def late(kept: float):
    """A clock that makes this share of its ticks, as on a computer that is too slow."""

    class Late(SimulatedClock):
        def step(self):
            while (self.now // self.period + 1) * kept % 1.0 >= kept:
                super().step()
                self.missed += 1
            return super().step()

    return lambda plan, pace: Late(plan.control_rate)


@pytest.mark.thorough
@pytest.mark.parametrize(("kept", "green"), [(1.0, True), (0.55, True), (0.34, False)])
def test_a_computer_that_is_too_slow_is_red_before_a_real_vehicle_arms(kept, green, monkeypatch):
    monkeypatch.setattr("kybflow.api.flight.clock_for", late(kept))
    line = checks(flight(), simulated=False)["a", "computer"]
    assert line.green is green
    made, due = re.findall(r"\d+", line.reason)[:2]
    assert int(made) / int(due) == pytest.approx(kept, abs=0.01)
    assert green or "`control`" in line.reason


@pytest.mark.thorough
def test_a_late_computer_is_told_and_its_missed_ticks_are_in_the_summary(run, monkeypatch):
    monkeypatch.setattr("kybflow.api.flight.clock_for", late(0.34))
    flown, told = run(flight())
    found = [event for event in told if event.name == "ticks_missed"]
    assert found[0].time < 1.1 * NS
    assert found[0].fields["value"] == pytest.approx(0.34, abs=0.01)
    assert len(found) == 1 + int(flown.summary["sim_time_s"]) // 10
    assert flown.summary["missed_ticks"] == pytest.approx(
        0.66 * 250 * flown.summary["sim_time_s"], rel=0.01
    )
    assert flown.exit_code == 0
