"""MAVProxy takes an emulated autopilot for a real one: a person at its prompt arms, flies and
lands."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from queue import Empty, Queue
from threading import Thread

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")
PROGRAM = shutil.which("mavproxy.py", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
if PROGRAM is None:
    pytest.skip("MAVProxy is not installed: pip install MAVProxy", allow_module_level=True)

from served_autopilots import emulated  # noqa: E402
from waiting import HANGS, free_port  # noqa: E402

pytestmark = [pytest.mark.peer, pytest.mark.filterwarnings("ignore")]


class Prompt:
    """MAVProxy's, with what it prints."""

    def __init__(self, folder, *arguments):
        self.program = subprocess.Popen(
            [sys.executable, PROGRAM, f"--state-basedir={folder}", "--nowait", *arguments],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            cwd=folder, env={**os.environ, "HOME": str(folder)},
        )  # fmt: skip
        self._lines = Queue()
        self.printed = []
        Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.program.stdout:
            self._lines.put(line)

    def type(self, line):
        self.program.stdin.write(f"{line}\n")
        self.program.stdin.flush()

    def reads(self, pattern, again=None):
        """Wait until a line matches; meanwhile type `again` every second."""
        deadline = time.monotonic() + HANGS
        while time.monotonic() < deadline:
            try:
                line = self._lines.get(timeout=1.0)
            except Empty:
                if again is not None:
                    self.type(again)
                continue
            self.printed.append(line)
            if found := re.search(pattern, line):
                return found
        raise AssertionError(f"no {pattern!r} in:\n{''.join(self.printed)}")

    def close(self):
        self.program.kill()
        self.program.wait()
        self.program.stdin.close()
        self.program.stdout.close()


def test_a_person_at_its_prompt_flies_an_emulated_ardupilot(tmp_path):
    port = free_port()
    with emulated("--vehicle", "ardupilot", "--address", f"tcpin:127.0.0.1:{port}"):
        prompt = Prompt(tmp_path, f"--master=tcp:127.0.0.1:{port}")
        try:
            prompt.reads(r"Received \d+ parameters")
            prompt.type("mode guided")
            prompt.reads("Mode GUIDED")
            prompt.reads(r"COMPONENT_ARM_DISARM: ACCEPTED", again="arm throttle")
            prompt.type("takeoff 2")
            prompt.reads("NAV_TAKEOFF: ACCEPTED")
            prompt.reads(r"relative_alt : (1[89]|2\d)\d\d,", again="status GLOBAL_POSITION_INT")
            prompt.type("mode land")
            prompt.reads("Mode LAND")
            prompt.reads("DISARMED")
        finally:
            prompt.close()


def test_a_person_at_its_prompt_flies_an_emulated_px4(tmp_path):
    """By the numbers of PX4's modes, whose names its prompt doesn't send."""
    port = free_port()
    with emulated("--vehicle", "px4", "--address", f"udpout:127.0.0.1:{port}"):
        prompt = Prompt(tmp_path, f"--master=udpin:127.0.0.1:{port}")
        try:
            prompt.reads(r"Received \d+ parameters")
            prompt.reads(r"COMPONENT_ARM_DISARM: ACCEPTED", again="arm throttle")
            prompt.type("long DO_SET_MODE 1 4 2 0 0 0 0")
            prompt.reads("Mode TAKEOFF")
            prompt.reads(r"relative_alt : (1[89]|2\d)\d\d,", again="status GLOBAL_POSITION_INT")
            prompt.type("long DO_SET_MODE 1 4 6 0 0 0 0")
            prompt.reads("Mode LAND")
            prompt.reads("DISARMED")
        finally:
            prompt.close()
