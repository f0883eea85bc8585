"""`kybflow emulate ardrone` as a program of its own, on an address that no other test has."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from threading import Thread

from waiting import HANGS

_NUMBERS = itertools.count()


def free_host(count=1):
    """The first of some loopback addresses of this process's own."""
    number = next(_NUMBERS)
    process = os.getpid()
    return f"127.{2 + process % 250}.{process // 250 % 250}.{2 + number * 8 % 240}"


class ServedDrones:
    """The program. `said`: its lines so far."""

    def __init__(self, host, arguments):
        command = [sys.executable, "-m", "kybflow", "emulate", "ardrone", "--host", host]
        self.host, self.said = host, []
        self.program = subprocess.Popen(
            [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self._reader = Thread(target=self._read, daemon=True)

    def start(self):
        line = self.program.stdout.readline()
        assert " is at " in line, line + self.program.stderr.read()
        self.said.append(line)
        self._reader.start()

    def has_said(self, words):
        return any(words in line for line in [*self.said])

    def end(self):
        self.program.send_signal(signal.SIGINT)
        assert self.program.wait(HANGS) == 0, self.program.stderr.read()
        self._reader.join(HANGS)
        return self.said

    def _read(self):
        self.said.extend(iter(self.program.stdout.readline, ""))


@contextmanager
def served(*arguments, host=None):
    """The program, once it says that it is there; it ends by Ctrl-C, without an error."""
    drones = ServedDrones(host or free_host(), arguments)
    try:
        drones.start()
        yield drones
        if drones.program.poll() is None:
            drones.end()
    finally:
        drones.program.kill()
        drones.program.wait()
        drones.program.stdout.close()
        drones.program.stderr.close()
