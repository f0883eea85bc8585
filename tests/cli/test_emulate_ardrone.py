"""`kybflow emulate ardrone` and `mocap-server` say what is wrong with their command lines, and what
is taken."""

from __future__ import annotations

import socket
from socket import SOCK_DGRAM, SOCK_STREAM

import pytest
from served_drones import free_host
from toolchain import invoke


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--host", "192.168.1.1"], 3, "192.168.1.1 is not a loopback address"),
        (["--host", "drone"], 3, "`drone` is not an IPv4 address"),
        (["--fail", "nonsense"], 2, "nothing called `nonsense` can fail"),
        (["--loss", "2"], 2, "--loss"),
        (["--loss", "nan"], 2, "nan is not finite"),
    ],
)
def test_what_is_wrong_is_said(arguments, code, said):
    found = invoke("emulate", "ardrone", *arguments)
    assert (found.exit_code, said in found.output) == (code, True), found.output


@pytest.mark.parametrize(
    ("port", "kind"), [(5556, SOCK_DGRAM), (5554, SOCK_DGRAM), (5559, SOCK_STREAM)]
)
def test_an_address_that_is_taken_is_named(port, kind):
    host = free_host()
    with socket.socket(type=kind) as other:
        other.bind((host, port))
        if kind == SOCK_STREAM:
            other.listen()
        found = invoke("emulate", "ardrone", "--host", host)
    name = "TCP" if kind == SOCK_STREAM else "UDP"
    assert (
        f"error: no drone can be at {host}, {name} port {port}: address already in use; "
        "is another emulated drone there? End it, or take another address"
    ) in found.output
    assert found.exit_code == 3


def test_a_vrpn_server_s_port_that_is_taken_is_named():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        found = invoke("mocap-server", "--still", "a=0,0,0", "--port", str(port))
    assert f"no VRPN server can be at 127.0.0.1:{port}: Address already in use" in found.output
    assert "take another `--port`" in found.output
    assert found.exit_code == 3
