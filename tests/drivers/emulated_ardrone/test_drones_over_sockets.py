"""The driver for real drones over sockets, in real time: in another program than the drone, killed
in flight, and beside one in memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from ardrone_flights import AgesOnReceipt, mission, succeeded
from served_drones import served
from waiting import HANGS, until

from kybflow.api.flight import RunRequest

LIKE = "    like: std.ardrone\n"
PATIENT = f"{LIKE}    supervisors: [{{use: link, age: 1.5 s, delay: 1 s}}]\n"
"""A machine that does something else beside answers late, which is not the network's doing."""
MISSION = """kybflow: 1
mission: by_its_own_odometry
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-3, -3, 0], to: [3, 3, 2.5]}}}}
targets:
  there: {{all: {{driver: {{use: ardrone, host: {host}, rate: 50 Hz}}}}}}
vehicles:
  a:
    like: std.ardrone
    start: {{at: [0, 0, 0]}}
    estimators: [{{use: autopilot}}]
    behaviors:
      up:   {{do: take_off, height: 1 m, then: away, within: 20 s}}
      away: {{do: fly_to, position: [0.8, 0, 1], then: hold}}
      hold: {{do: hover, for_time: {hold} s, then: down}}
      down: {{do: land}}
"""


def program(host, hold, folder):
    """`kybflow run` on the drone at `host`, on its own odometry."""
    path = folder / "flight.yaml"
    text = MISSION.format(host=host, hold=hold).replace(LIKE, PATIENT)
    path.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "kybflow", "run", str(path), "--target", "there"]
    return subprocess.Popen(
        [*command, "--out", str(folder / "run")],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ,
    )  # fmt: skip


@pytest.mark.thorough
def test_a_mission_flies_on_a_drone_s_own_odometry_through_a_bad_network(tmp_path):
    with served("--loss", "0.05", "--latency", "0.02", "--jitter", "0.02") as drones:
        flight = program(drones.host, 3, tmp_path)
        said, _ = flight.communicate(timeout=HANGS)
        assert flight.returncode == 0, said
        assert drones.has_said("v1 is landed")


@pytest.mark.thorough
def test_killed_in_flight_the_drone_lands_itself_and_nobody_sends(tmp_path):
    with served() as drones:
        flight = program(drones.host, 120, tmp_path)
        try:
            until(lambda: drones.has_said("v1 is flying") or flight.poll(), "flight")
            assert flight.poll() is None, flight.stdout.read()
            flight.send_signal(signal.SIGKILL)
            flight.wait()
            until(lambda: drones.has_said("v1 is landing"), "the watchdog")
            until(lambda: drones.has_said("v1 is landed"), "the ground")
        finally:
            flight.kill()
            flight.wait()
            flight.stdout.close()


RATES = [30, 50, 100, 200]
OLDEST, HELD = 0.1, 0.2
"""Seconds: of a command as it arrives, and as it is sent."""


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [RATES[0], pytest.param(RATES[-1], marks=pytest.mark.slow)])
def test_three_drones_over_sockets_on_a_bad_link(rate, tmp_path, monkeypatch):
    ages = check_connection(rate, 8.0, tmp_path, monkeypatch)
    assert ages[len(ages) // 2] <= OLDEST


@pytest.mark.slow
@pytest.mark.parametrize("rate", RATES)
def test_three_drones_for_a_minute_over_sockets(rate, tmp_path, monkeypatch):
    ages = check_connection(rate, 60.0, tmp_path, monkeypatch)
    assert ages[round(0.999 * len(ages))] <= OLDEST  # a busy machine may be late once


def patient(names, seconds):
    return mission(names, seconds).replace(LIKE, PATIENT)


def check_connection(rate, seconds, out, monkeypatch):
    """The ages of all commands on receipt, sorted. Nobody was lost, whatever the machine did
    beside, and no command was sent that was too old."""
    ages = AgesOnReceipt(monkeypatch)
    bad = {"wifi_latency": 0.02, "wifi_jitter": 0.02, "wifi_loss": 0.05}
    request, text = RunRequest(out=out / "run"), patient(["a", "b", "c"], seconds)
    _, told, session = succeeded(text, out, request=request, rate=rate, network=True, **bad)
    assert "link_lost" not in [event.name for event in told]
    assert not any(link.drone.times_lost for link in session.links.values())
    assert 0.0 < ages.most_held <= HELD
    return sorted(ages.seconds)


@pytest.mark.slow  # two flights in real time; the thorough ones over sockets have their own bounds
def test_over_sockets_it_flies_as_in_memory(tmp_path):
    errors = []
    for network in (False, True):
        out = tmp_path / str(network)
        out.mkdir()
        request = RunRequest(out=out / "run")
        text = patient(["a", "b"], 16.0)
        flight, *_ = succeeded(text, out, request=request, network=network)
        records = flight.summary["vehicles"].values()
        errors.append([r["position_error_m"]["mean"] for r in records])
    for memory, sockets in zip(*errors, strict=True):
        assert sockets == pytest.approx(memory, rel=0.2)
