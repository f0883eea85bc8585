"""kill -9 of the program that flies, over real sockets and in real time: a third MAVLink connection
sees the vehicle land and stop its rotors."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from framing import INTERVAL, Framing
from served_autopilots import emulated
from waiting import HANGS, free_port

from kybflow.drivers.mavlink.protocol.framing import NUMBERS
from kybflow.drivers.mavlink.transport.router import heartbeat
from kybflow.drivers.mavlink.transport.sockets import open_wire

pytestmark = pytest.mark.thorough
ARMED, IN_AIR, ON_GROUND = 128, 2, 1
MISSION = """
kybflow: 1
mission: killed
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}}}
targets:
  there:
    all:
      driver: {{use: mavlink, autopilot: {autopilot}, address: "{address}", simulator: true}}
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up:   {{do: take_off, height: 80 cm, then: hold}}
      hold: {{do: hover, for_time: 60 s, then: down}}
      down: {{do: land}}
"""


class Onlooker:
    """A third connection: it hears, and says nothing but that it is there."""

    def __init__(self, address):
        from pymavlink.dialects.v20 import all as mavlink

        self._wire, self._framing = open_wire(address), Framing(250)
        self._here = heartbeat(mavlink.MAV_TYPE_GCS)
        self._ask = mavlink.MAVLink_command_long_message(
            1, 1, INTERVAL, 0, NUMBERS["EXTENDED_SYS_STATE"], 2e5, 0, 0, 0, 0, 0
        )
        self.armed, self.landed, self._said = None, None, 0.0

    def until(self, found):
        """Look until `found` holds; whether it does before the deadline."""
        end = time.monotonic() + HANGS
        while time.monotonic() < end:
            now = time.monotonic()
            if now - self._said > 1.0:
                self._said = now
                self._wire.send(self._framing.pack(self._here))
                self._wire.send(self._framing.pack(self._ask))
            for data, _ in self._wire.receive(round(now * 1e9)):
                for message in self._framing.parse(data):
                    self._hear(message)
            if found(self):
                return True
            os.sched_yield()
        return False

    def _hear(self, message):
        if message.get_type() == "HEARTBEAT":
            self.armed = bool(message.base_mode & ARMED)
        elif message.get_type() == "EXTENDED_SYS_STATE":
            self.landed = message.landed_state

    def close(self):
        self._wire.close()


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_it_lands_when_the_program_is_killed(autopilot, tmp_path):
    ours, third = free_port(), free_port()
    file = tmp_path / "killed.yaml"
    text = MISSION.format(autopilot=autopilot, address=f"udpout:127.0.0.1:{ours}")
    file.write_text(text, encoding="utf-8")
    served = (
        "--vehicle", autopilot, "--no-gps", "--airframe", "nano_plus",
        "--address", f"udpin:127.0.0.1:{ours}", "--address", f"tcpin:127.0.0.1:{third}",
    )  # fmt: skip
    with emulated(*served):
        onlooker = Onlooker(f"tcp:127.0.0.1:{third}")
        command = [sys.executable, "-m", "kybflow", "run", str(file), "--target", "there"]
        program = subprocess.Popen(
            [*command, "--out", str(tmp_path / "run")],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            flies = onlooker.until(lambda seen: seen.armed and seen.landed == IN_AIR)
            assert flies, (program.poll(), onlooker.armed, onlooker.landed)
            program.kill()
            program.wait()
            assert onlooker.until(lambda seen: seen.armed is False)
            assert onlooker.until(lambda seen: seen.landed == ON_GROUND)
        finally:
            program.kill()
            program.wait()
            onlooker.close()
