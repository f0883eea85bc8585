"""`kybflow emulate autopilot` as a program of its own, on a port of this machine that is free."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager

UDP, TCP = socket.SOCK_DGRAM, socket.SOCK_STREAM


def free_port(kind=UDP):
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


@contextmanager
def emulated(*arguments):
    """The program, once it says that it is there; it ends by Ctrl-C, without a word."""
    command = [sys.executable, "-m", "kybflow", "emulate", "autopilot", *arguments]
    program = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    )
    try:
        assert "speaks at" in program.stdout.readline()
        yield program
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=300)
        assert (program.returncode, errors) == (0, "")
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
        program.stderr.close()
