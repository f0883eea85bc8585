"""The pose streams of moving obstacles: from the system that tracks a vehicle, or simulated."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import compiled
from waiting import free_port, until

from kybflow.api.opening import open_devices
from kybflow.core.signals import NS, Measurement, Pose
from kybflow.dsl.plan import Plan
from kybflow.sensors.vrpn.server import Server

MISSION = """\
kybflow: 1
mission: ball
import: {{std: kybflow/airframes}}
world:
  fence: {{from: [-3, -3, 0], to: [3, 3, 2.5]}}
  obstacles:
    ball:
      moving_sphere:
        {{along: [[2, -2, 1], [2, 2, 1]], radius: 15 cm, speed: 50 cm/s, body: ball_7}}
    kite: {{moving_sphere: {{along: [[-2, -2, 2], [-2, 2, 2]], radius: 15 cm, speed: 50 cm/s}}}}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up:   {{do: take_off, height: 1 m, then: down}}
      down: {{do: land}}
targets:
  lab: {{a: {{driver: sim, sensors: {{mocap: {{use: vrpn, host: "127.0.0.1:{port}"}}}}}}}}
  late:
    a: {{driver: sim, sensors: {{mocap: {{use: simulated_motion_capture, latency: 50 ms}}}}}}
"""


def planned(folder: Path, target: str | None, port: int = 3883) -> Plan:
    return compiled(folder / "mission.yaml", MISSION.format(port=port), target=target)


def test_the_vehicles_system_sees_them_by_their_bodies(tmp_path: Path) -> None:
    port = free_port()
    server, plan = Server(port=port), planned(tmp_path, "lab", port)
    assert {name: vehicle for name, (vehicle, _) in plan.watching.items()} == {
        "ball": "a", "kite": "a",
    }  # fmt: skip
    devices = open_devices(plan, 0)
    came: dict[str, list[Measurement]] = {"ball": [], "kite": []}
    stamps = iter(range(1, 10**6))

    def both_seen() -> bool:
        now = next(stamps) * NS // 100
        for body, x in (("ball_7", 1.0), ("kite", -1.0), ("a", 0.0)):
            server.publish(body, (x, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), now)
        for name, stream in devices.watching.items():
            came[name] += stream.read(now)
        return all(came.values())

    try:
        until(both_seen, "poses of both")
    finally:
        assert devices.close() == []
        server.close()
    places = {name: {p.position for p in poses if type(p) is Pose} for name, poses in came.items()}
    assert places == {"ball": {(1.0, 0.0, 1.0)}, "kite": {(-1.0, 0.0, 1.0)}}


@pytest.mark.parametrize(("target", "latency"), [(None, 0.01), ("late", 0.05)])
def test_simulated_they_are_seen_as_vehicles_are(
    tmp_path: Path, target: str | None, latency: float
) -> None:
    devices = open_devices(planned(tmp_path, target), 0)
    stream = devices.watching["kite"]
    first = next(i for i in range(100) if stream.read(i * NS // 1000))
    assert first / 1000 == pytest.approx(latency, abs=1e-3)
    assert devices.close() == []
