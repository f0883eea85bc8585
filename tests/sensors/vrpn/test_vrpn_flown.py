"""A simulated vehicle flies in real time on its own motion capture, over the network."""

from __future__ import annotations

from pathlib import Path

import pytest
from short_flights import named
from toolchain import compiled, succeeds
from waiting import free_port

from kybflow.core.signals import NS, Pose
from kybflow.sensors.vrpn.server import Server, published

MISSION = """\
kybflow: 1
mission: network
import: {{std: kybflow/airframes}}
world:
  fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  nano:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    estimators:
      - {{use: mocap, healthy: age < 250 ms and spread < 5 cm, recover_after: 1 s}}
      - {{use: inertial, healthy: spread < 30 cm, for_at_most: 3 s}}
    behaviors:
      up:   {{do: take_off, height: 50 cm, then: hold, within: 15 s}}
      hold: {{do: hover, for_time: 5 s, then: down}}
      down: {{do: land}}
targets:
  lab:
    all:
      driver: sim
      sensors: {{mocap: {{use: vrpn, host: "127.0.0.1:{port}", opening: {opening}}}}}
expect:
  - finally nano in landed
  - max(nano.position_error) < 30 cm
"""
LOST, BACK = 5.0, 6.0


class Unreliable:
    """Publishes, but ends the server at LOST and begins another at BACK."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.server: Server | None = Server(port=port)

    def publish(self, name: str, pose: Pose) -> None:
        dead = LOST <= pose.time / NS < BACK
        if dead and self.server is not None:
            self.server.close()
            self.server = None
        elif not dead and self.server is None:
            self.server = Server(port=self._port)
        if self.server is not None:
            self.server.publish(name, pose.position, pose.attitude, 10**9 * NS + pose.time)


@pytest.mark.slow  # the flight takes as long as it takes
@pytest.mark.parametrize("opening", ["direct", "lob"])
def test_a_server_that_is_restarted_in_flight(opening: str, tmp_path: Path) -> None:
    port = free_port()
    text = MISSION.format(port=port, opening=opening)
    plan = compiled(tmp_path / "network.yaml", text, target="lab", warns=True)
    network = Unreliable(port)
    _, events = succeeds(published(plan, network.publish), tmp_path / "run", speed=1.0)
    assert network.server is not None
    network.server.close()
    changes = named(events, "estimator_changed")
    assert [event.fields["estimator"] for event in changes] == ["mocap", "inertial", "mocap"]
    _, lost, back = (event.time / NS for event in changes)
    assert LOST + 0.25 - 0.02 < lost < LOST + 0.25 + 0.1  # 100 ms after the health's bound
    told = [event for event in events if event.name.startswith("sensor_")]
    assert [event.name for event in told] == ["sensor_failed", "sensor_recovered"]
    assert LOST < told[0].time / NS < lost
    assert str(told[0].fields["reason"]).startswith(f"no VRPN server at 127.0.0.1:{port}: ")
    assert "; no VRPN server at " in str(changes[1].fields["reason"])
    assert back > BACK + 1.0  # what was lost counts again after `recover_after`


BALL = """\
kybflow: 1
mission: ball
import: {{std: kybflow/airframes}}
world:
  fence: {{from: [-3, -3, 0], to: [3, 3, 2.5]}}
  obstacles:
    ball:
      moving_sphere:
        {{along: [[0, 2.4, 1], [0, -2.4, 1]], radius: 15 cm, speed: 40 cm/s, body: ball_7}}
vehicles:
  nano:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    processors:
      - limit_speed
      - limit_acceleration
      - {{use: avoid_obstacles, keep: 20 cm}}
      - fence
      - position_error
    behaviors:
      up:   {{do: take_off, height: 1 m, then: hold, within: 15 s}}
      hold: {{do: hover, for_time: 6 s, then: down}}
      down: {{do: land}}
targets:
  lab:
    all:
      driver: sim
      sensors: {{mocap: {{use: vrpn, host: "127.0.0.1:{port}"}}}}
expect:
  - finally nano in landed
  - eventually distance(nano to [0 0 1]) > 20 cm    # it has given way
"""


@pytest.mark.slow  # the flight takes as long as it takes
def test_a_ball_that_the_network_sees_is_given_way_to(tmp_path: Path) -> None:
    port = free_port()
    plan = compiled(tmp_path / "ball.yaml", BALL.format(port=port), target="lab", warns=True)
    server = Server(port=port)
    gone = 9 * NS

    def publish(name: str, pose: Pose) -> None:
        if name == "nano" or pose.time < gone:
            server.publish(name, pose.position, pose.attitude, 10**9 * NS + pose.time)

    _, events = succeeds(published(plan, publish), tmp_path / "run")
    server.close()
    [lost] = [event for event in events if event.name.startswith("obstacle_")]
    assert lost.fields["obstacle"] == "ball"
    assert gone + 0.45 * NS < lost.time < gone + 0.6 * NS
