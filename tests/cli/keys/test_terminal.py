"""A real terminal: keys come one by one, and whatever happens the shell gets it back as it was."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import termios
from collections.abc import Iterator

import pytest
from waiting import until

CHILD = """
import os, signal, sys, time
number = os.open(sys.argv[1], os.O_RDWR)  # whoever leads a session gets the terminal that it opens
os.tcsetpgrp(number, os.getpgrp())
from kybflow.core.terminal import Terminal
signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))
with Terminal(number, number) as terminal:
    print("ready", flush=True)
    while True:
        data = terminal.read()
        if data:
            print(data, flush=True)
        if data == b"q":
            break
        if data == b"e":
            raise ValueError("a part raises")
        time.sleep(0.002)
print("left", flush=True)
"""


class Child:
    """A program that reads keys from a terminal of its own."""

    def __init__(self) -> None:
        self.master, self.slave = os.openpty()
        self.before = termios.tcgetattr(self.slave)
        words = [sys.executable, "-c", CHILD, os.ttyname(self.slave)]
        self.program = subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        self.expect(b"ready")
        until(self.is_taken, "the terminal is set up")

    def type(self, keys: bytes) -> None:
        os.write(self.master, keys)

    def expect(self, line: bytes) -> None:
        assert self.program.stdout is not None
        assert self.program.stdout.readline().strip() == line

    def now(self) -> list[object]:
        return termios.tcgetattr(self.slave)

    def is_taken(self) -> bool:
        return not self.now()[3] & termios.ICANON  # type: ignore[operator]

    def screen(self) -> bytes:
        """What was written since the last time."""
        shown = b""
        while select.select([self.master], [], [], 0.05)[0]:
            shown += os.read(self.master, 4096)
        return shown

    def close(self) -> None:
        self.program.kill()
        self.program.communicate()
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def child() -> Iterator[Child]:
    child = Child()
    yield child
    child.close()


def test_keys_come_at_once_and_are_not_echoed(child: Child) -> None:
    child.type(b"p")
    child.expect(b"b'p'")
    child.type(b"\x13l")
    child.expect(b"b'\\x13l'")
    assert b"p" not in child.screen()
    child.type(b"q")
    child.expect(b"b'q'")
    child.expect(b"left")
    assert child.now() == child.before
    assert child.screen().endswith(b"\x1b[?2004l")


@pytest.mark.parametrize("key", [b"e", b"\x03"])
def test_it_is_given_back_after_an_error_and_after_ctrl_c(child: Child, key: bytes) -> None:
    child.type(key)
    assert child.program.wait() != 0
    assert child.now() == child.before


def test_it_is_given_back_after_sigterm(child: Child) -> None:
    child.program.terminate()
    assert child.program.wait() == 1
    assert child.now() == child.before


def test_keys_that_nobody_read_do_not_reach_the_shell(child: Child) -> None:
    os.kill(child.program.pid, signal.SIGSTOP)
    child.type(b"qrm -r runs")
    os.kill(child.program.pid, signal.SIGCONT)
    child.program.terminate()
    child.program.wait()
    assert child.now() == child.before
    os.set_blocking(child.slave, False)
    child.type(b"\n")
    assert os.read(child.slave, 100) == b"\n"


def test_somebody_who_changes_it_back_is_overruled(child: Child) -> None:
    termios.tcsetattr(child.slave, termios.TCSANOW, child.before)
    until(child.is_taken, "it is set up again")


def test_a_terminal_that_is_closed_ends_nothing(child: Child) -> None:
    os.kill(child.program.pid, signal.SIGSTOP)
    os.close(child.master)
    child.master = os.open(os.devnull, os.O_RDONLY)
    os.kill(child.program.pid, signal.SIGCONT)
    child.program.terminate()
    assert child.program.wait() in (1, -signal.SIGHUP)
