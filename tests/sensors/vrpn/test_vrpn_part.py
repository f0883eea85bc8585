"""The part `vrpn`: a body's poses on the run's clock, in the world."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from part_bench import SITE
from waiting import until

from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS, Measurement, Pose
from kybflow.sensors._stream import PoseSource, PoseStream, TrackerPose
from kybflow.sensors.vrpn import Vrpn, VrpnParams
from kybflow.sensors.vrpn.server import Server

MS = NS // 1000


class Script(PoseSource):
    """A subscription that gives what is put into `poses`."""

    closed = False

    def trouble(self) -> str | None:
        return "no server"

    def close(self) -> None:
        self.closed = True


def opened(params: VrpnParams, monotonic: list[int]) -> tuple[Script, PoseStream]:
    script, p = Script(), params
    return script, PoseStream(script, p.units, p.axes, p.latency, lambda: monotonic[0])


def test_it_gives_poses() -> None:
    assert Vrpn.provides == {Pose}
    assert not Vrpn.simulated


def test_poses_are_on_the_clock_of_the_run() -> None:
    """The run began at 100 s of the monotonic clock; ticks are late by some microseconds."""
    monotonic = [0]
    script, stream = opened(VrpnParams(host="h"), monotonic)
    for tick, late in ((0, 300_000), (4 * MS, 20_000), (8 * MS, 900_000)):
        monotonic[0] = 100 * NS + tick + late
        assert stream.read(tick) == []
    script.poses.append(TrackerPose(100 * NS + 9 * MS, 100 * NS + 9 * MS, (1.0, 2.0, 3.0), LEVEL))
    monotonic[0] = 100 * NS + 12 * MS + 100_000
    assert stream.read(12 * MS) == [Pose(9 * MS - 20_000, (1.0, 2.0, 3.0), LEVEL)]


def test_no_pose_is_newer_than_now_and_the_latency_is_taken_off() -> None:
    monotonic = [100 * NS]
    script, stream = opened(VrpnParams(host="h", latency=0.005), monotonic)
    for tick in range(3):
        monotonic[0] = 100 * NS + tick * MS
        assert stream.read(tick * MS) == []
    monotonic[0] = 100 * NS + 50 * MS + 30_000
    script.poses.append(TrackerPose(monotonic[0] - 10_000, monotonic[0], (0.0, 0.0, 0.0), LEVEL))
    assert [pose.time for pose in stream.read(50 * MS)] == [45 * MS]


def test_units_and_axes_are_the_worlds_and_lost_bodies_are_left_out() -> None:
    script, stream = opened(VrpnParams(host="h", units="mm", axes="y_up"), [0])
    lost = TrackerPose(0, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    script.poses.extend((lost, TrackerPose(0, 0, (1000.0, 2000.0, 3000.0), LEVEL)))
    (pose,) = stream.read(0)
    assert isinstance(pose, Pose)
    assert pose.position == pytest.approx((1.0, -3.0, 2.0))


def test_what_is_wrong_and_the_end_are_passed_on() -> None:
    script, stream = opened(VrpnParams(host="h"), [0])
    assert stream.trouble() == "no server"
    stream.close()
    assert script.closed


def test_a_host_that_is_none_is_objected_to_when_the_mission_is_compiled() -> None:
    assert Vrpn.objection(VrpnParams(host="vicon:3883"), {}) is None
    found = Vrpn.objection(VrpnParams(host="uav1@vicon"), {})
    assert found is not None
    assert (found.parameter, found.reason) == ("host", "`uav1@vicon` is not a VRPN server")
    assert "`HOST:3883`" in found.hint
    assert Vrpn.objection(VrpnParams(host="tcp://vicon"), {}) is None
    assert Vrpn.objection(VrpnParams(host="tcp://vicon", opening="lob"), {}) is not None


def test_a_host_that_is_none_is_refused() -> None:
    with pytest.raises(DriverError, match="`uav1@vicon` is not a VRPN server"):
        Vrpn.open(VrpnParams(host="uav1@vicon"), SITE, None, random.Random(0))  # type: ignore[arg-type]


@pytest.mark.parametrize("opening", ["direct", "lob"])
@pytest.mark.parametrize("body", [None, "courier"])
def test_a_vehicle_takes_the_body_with_its_name_or_another(body: str | None, opening: str) -> None:
    server = Server(port=0)
    params = replace(VrpnParams(host=f"127.0.0.1:{server.port}"), body=body, opening=opening)
    stream = Vrpn.open(params, SITE, None, random.Random(0))  # type: ignore[arg-type]
    came: list[Measurement] = []

    def some() -> bool:
        server.publish(body or SITE.vehicle, (1.0, 2.0, 3.0), LEVEL)
        server.publish("another", (0.0, 0.0, 0.0), LEVEL)
        came.extend(stream.read(NS))
        return len(came) > 3

    until(some, "poses")
    stream.close()
    server.close()
    assert {pose.position for pose in came if isinstance(pose, Pose)} == {(1.0, 2.0, 3.0)}
    assert all(0 <= pose.time <= NS for pose in came)
