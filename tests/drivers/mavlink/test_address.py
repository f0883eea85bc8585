"""Addresses of autopilots, and what to write in place of a bad one."""

from __future__ import annotations

import subprocess
import sys

import pytest

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.transport.wire import Address, read_address


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udpin:0.0.0.0:14540", Address("udpin", "0.0.0.0", 14540)),
        ("udpin:14540", Address("udpin", "127.0.0.1", 14540)),
        (" udpout:drone.lab:14580 ", Address("udpout", "drone.lab", 14580)),
        ("tcp:127.0.0.1:5760", Address("tcp", "127.0.0.1", 5760)),
        ("tcpin:5760", Address("tcpin", "127.0.0.1", 5760)),
        ("serial:/dev/ttyUSB0:57600", Address("serial", "/dev/ttyUSB0", 57600)),
        ("serial:COM3:921600", Address("serial", "COM3", 921600)),
        (
            "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0:57600",
            Address("serial", "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0", 57600),
        ),
    ],
)
def test_an_address_is_written_like_this(text: str, expected: Address) -> None:
    assert expected == read_address(text)
    assert expected == read_address(str(expected))


@pytest.mark.parametrize(
    ("text", "way_out"),
    [
        ("", "write `udpin:HOST:PORT`"),
        ("127.0.0.1:14540", "write `udpin:HOST:PORT`"),
        ("udp:127.0.0.1:14540", "write `udpin:127.0.0.1:14540` to wait .* or `udpout:"),
        ("UDPIN:1.2.3.4:1", "write `udpin:HOST:PORT`"),
        ("udpin:", "write `udpin:HOST:PORT`"),
        ("udpin:a b:14540", "write `udpin:HOST:PORT`"),
        ("udpin:[::1]:14540", "write `udpin:HOST:PORT`"),
        ("udpout:14540", "says no host: write `udpout:HOST:14540`"),
        ("tcp:5760", "says no host: write `tcp:HOST:5760`"),
        ("tcp://127.0.0.1:5760", "write `tcp:HOST:PORT`"),
        ("udpin:127.0.0.1:0", "ports go from 1 to 65535"),
        ("tcp:localhost:65536", "ports go from 1 to 65535"),
        ("serial:/dev/ttyUSB0", "write `serial:DEVICE:BAUD`, as in"),
        ("serial:/dev/ttyUSB0:fast", "write `serial:DEVICE:BAUD`, as in"),
        ("serial::57600", "write `serial:DEVICE:BAUD`, as in"),
    ],
)
def test_a_bad_one_says_what_to_write(text: str, way_out: str) -> None:
    with pytest.raises(DriverError, match=way_out):
        read_address(text)


def test_neither_pymavlink_nor_pyserial_is_needed_to_read_one() -> None:
    program = (
        "import sys\nsys.modules['pymavlink'] = sys.modules['serial'] = None\n"
        "from kybflow.drivers.mavlink.transport.wire import read_address\n"
        "print(read_address('udpin:1'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    )
    assert done.stdout == "udpin:127.0.0.1:1\n"
