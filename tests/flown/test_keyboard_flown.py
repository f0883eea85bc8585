"""A mission that is steered by the keys of its terminal: a real program in a real terminal."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from kybflow.inputs.rows import parse

FORWARD = b"\x1b[A"
MISSION = """\
kybflow: 1
mission: keys
import: {std: kybflow/airframes}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
inputs: {keys: {use: keyboard}}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up:   {do: take_off, height: 60 cm, then: hand, within: 15 s}
      hand: {do: steer, input: keys, failed: down, next: [{event: keys.l, go: down}], within: 60 s}
      down: {do: land}
"""


PROGRAM = """
import os, sys
number = os.open(sys.argv[1], os.O_RDWR)  # whoever leads a session gets the terminal that it opens
os.tcsetpgrp(number, os.getpgrp())
for place in range(3):
    os.dup2(number, place)
os.execv(sys.executable, [sys.executable, "-m", "kybflow", *sys.argv[2:]])
"""


class Screen:
    """A run in a terminal of its own."""

    def __init__(self, folder: Path) -> None:
        (folder / "keys.yaml").write_text(MISSION, encoding="utf-8")
        words = ["run", "keys.yaml", "--speed", "1", "--no-report", "--out", "run"]
        self._terminal, own = os.openpty()
        self.program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, os.ttyname(own), *words],
            cwd=folder,
            start_new_session=True,
        )
        self.shown, self._events = b"", folder / "run" / "events.jsonl"

    def until(self, what: Callable[[], bool]) -> None:
        """Look at the screen until that holds."""
        deadline = time.monotonic() + 60.0
        while not what():
            assert time.monotonic() < deadline, self.shown[-2000:]
            if select.select([self._terminal], [], [], 0.02)[0]:
                try:
                    self.shown += os.read(self._terminal, 1 << 16)
                except OSError:  # the program has ended
                    return

    def told(self, event: str, **fields: str) -> bool:
        """Whether the run has told an event."""
        if not self._events.exists():
            return False
        lines = self._events.read_text(encoding="utf-8").split("\n")[:-1]
        events = [json.loads(line) for line in lines]
        return any(e["event"] == event and fields.items() <= e["fields"].items() for e in events)

    def wait(self, seconds: float) -> None:
        """Look at the screen for a while."""
        soon = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > soon)

    def types(self, keys: bytes) -> None:
        os.write(self._terminal, keys)


@pytest.mark.thorough
def test_keys_steer_and_a_letter_lands(tmp_path: Path) -> None:
    screen = Screen(tmp_path)
    screen.until(lambda: screen.told("behavior_started", behavior="hand"))
    for _ in range(10):
        screen.types(FORWARD)
        screen.wait(0.1)
    screen.types(b"l")
    screen.until(lambda: screen.told("run_ended"))
    screen.until(lambda: screen.program.poll() is not None)
    assert screen.program.returncode == 0, screen.shown[-2000:]
    said = parse((tmp_path / "run" / "inputs" / "keys.csv").read_text(encoding="utf-8"))
    *rows, ended = said.rows
    assert {0.0, 0.7} == {row.axes["x"] for row in rows}
    assert ended.lost
    assert said.buttons == ("l",)
