"""A drone is taken into a lab's network: what its shell is told, and a shell that a test plays."""

from __future__ import annotations

import shlex
import socket
import threading

import pytest
from toolchain import invoke

from kybflow.core.errors import DriverError
from kybflow.drivers.ardrone.joining import join_lines, run_lines

GREETING = b"\xff\xfd\x01\xff\xfd\x1f\xff\xfb\x01\r\n\r\nBusyBox v1.14.0\r\n\x1b[1m# "


def test_a_name_is_no_command():
    line, end = join_lines("a'; reboot; '", "192.168.1.11")
    assert shlex.split(line.partition(" essid ")[2])[0] == "a'; reboot; ';"
    assert end == "exit"


@pytest.mark.parametrize(
    ("ssid", "address", "netmask"),
    [
        ("", "192.168.1.11", "255.255.255.0"), ("x" * 33, "192.168.1.11", "255.255.255.0"),
        ("a\nb", "192.168.1.11", "255.255.255.0"), ("lab", "192.168.1", "255.255.255.0"),
        ("lab", "192.168.1.0", "255.255.255.0"), ("lab", "192.168.1.255", "255.255.255.0"),
        ("lab", "192.168.1.11", "255.0.255.0"), ("lab", "1.2.3.4; reboot", "255.255.255.0"),
    ],
)  # fmt: skip
def test_what_is_no_network_is_refused(ssid, address, netmask):
    with pytest.raises(DriverError):
        join_lines(ssid, address, netmask)


class PlayedShell:
    """A telnet shell that asks for lines until it is told to exit."""

    def __init__(self, greeting=GREETING):
        self.lines, self._greeting = [], greeting
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        client, _ = self._listener.accept()
        with client, client.makefile("rwb") as shell:
            shell.write(self._greeting)
            shell.flush()
            for line in shell:
                self.lines.append(line.decode().rstrip("\n"))
                if self.lines[-1] == "exit" or self._greeting != GREETING:
                    return
                shell.write(b"\r\n# ")
                shell.flush()

    def end(self):
        self._listener.close()
        self._thread.join(5.0)


def test_each_line_is_sent_when_the_shell_asks():
    shell, told, lines = PlayedShell(), [], join_lines("lab", "192.168.1.11")
    run_lines(lines, "127.0.0.1", told.append, shell.port)
    shell.end()
    assert shell.lines == told == lines


def test_nobody_at_home_is_told():
    with pytest.raises(DriverError, match="no shell on the drone at 127"):
        run_lines(["exit"], "127.0.0.1", print, 1)


def test_by_default_it_is_only_shown():
    command = ["ardrone", "join", "--ssid", "lab", "--address", "192.168.1.11"]
    found = invoke(*command)
    assert found.exit_code == 0
    assert "iwconfig ath0 mode managed essid lab;" in found.output
    assert "nothing is sent without --write" in found.output


def test_a_wrong_address_is_a_wrong_command_line():
    command = ["ardrone", "join", "--ssid", "lab", "--address", "x"]
    found = invoke(*command)
    assert found.exit_code == 2
    assert "`x` with `255.255.255.0` is not an IPv4 address" in found.output
