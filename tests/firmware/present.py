"""Which firmware's simulator is there. KYBFLOW_FIRMWARE says what was started: `px4`, `ardupilot`,
or both; docs/firmware.md says how."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from functools import cache

import pytest
from real_flights import ASKED

from kybflow.cli.commands.mavlink.meeting import ticks
from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.discovery import Discovery
from kybflow.drivers.mavlink.firmware import firmware_by, profile_of
from kybflow.drivers.mavlink.transport.sockets import open_wire

OWN = 245


@cache
def missing(autopilot: str, system: int) -> str:
    """Why that one can't be flown, empty where it can."""
    if autopilot not in ASKED:
        return f"real firmware: set KYBFLOW_FIRMWARE={autopilot} with its simulator running"
    address = profile_of(autopilot).default_address(system)
    try:
        with closing(open_wire(address)) as wire:
            discovery = Discovery(wire, system, OWN)
            discovery.find(ticks())
            found = firmware_by(discovery.statuses[system].autopilot)
    except DriverError as error:
        return f"real firmware: {error}"
    return "" if found == autopilot else f"real firmware: {address} is no {autopilot}"


def needed(autopilots: Mapping[int, str]) -> None:
    """Skip the test where one of those, by system id, is not there."""
    for system, autopilot in autopilots.items():
        if why := missing(autopilot, system):
            pytest.skip(why)
