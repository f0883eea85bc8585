"""`kybflow emulate autopilot` as a program of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import contextmanager

from waiting import HANGS


@contextmanager
def emulated(*arguments):
    """The program, once it says that it is there; it ends by Ctrl-C, without a word."""
    command = [sys.executable, "-m", "kybflow", "emulate", "autopilot", *arguments]
    program = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    )
    try:
        assert " is at " in program.stdout.readline()
        yield program
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=HANGS)
        assert (program.returncode, errors) == (0, "")
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
        program.stderr.close()
