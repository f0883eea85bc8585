"""A second ground station that commands the vehicle while a run flies it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from dry_runs import DRIVER, WRONG, DryRun
from pymavlink.dialects.v20 import all as mavlink

from kybflow.drivers.mavlink.protocol.framing import Packer
from kybflow.drivers.mavlink.transport.router import heartbeat
from kybflow.drivers.mavlink.transport.wire import memory_wires

STATION, RATE = 200, 37.0
thorough = pytest.mark.thorough
AUTOPILOTS = [pytest.param("px4", marks=thorough), "ardupilot"]


def station(*messages: Any, seconds: float) -> Callable[[DryRun], None]:
    """A ground station on a wire of its own, which sends these `RATE` times a second."""

    def begins(flight: DryRun) -> None:
        endpoint = flight.link._emulated.onboard
        wire, theirs = memory_wires("memory:station")
        endpoint.connect(theirs)
        packer, step, begun = Packer(STATION), endpoint.step, flight.engine.seconds()
        beat = heartbeat(mavlink.MAV_TYPE_GCS)
        sent = 0

        def stepping(now: int) -> None:
            nonlocal sent
            after = now / 1e9 - begun
            if RATE * after > sent and after < seconds:
                for message in (beat, *messages):
                    wire.send(packer.pack(message, 190))
                sent += 1
            step(now)

        endpoint.step = stepping

    return begins


def target() -> Any:
    away = (1.0, 0.0, -0.8)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0xDF8, *away, *[0.0] * 8
    )


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_foreign_set_points_are_told_with_the_station_and_no_success(autopilot, tmp_path) -> None:
    deeds = [(WRONG, station(target(), seconds=2.5))]
    flight = DryRun(autopilot, tmp_path, deeds=deeds)
    told = flight.only("foreign_command")
    assert (told.vehicle, told.at) == ("a", DRIVER)
    assert (
        "setpoints that this program did not send: position (1.0, 0.0, -0.8)"
        in (told.fields["reason"])
    )
    assert told.fields["reason"].endswith(f"ground station {STATION} is also connected")
    assert flight.at("foreign_command") - WRONG < 3.0
    assert flight.flown.summary["vehicles"]["a"]["foreign_commands"] == [told.fields["reason"]]
    assert "another program commanded it: it follows" in flight.flown.summary["reason"]
    assert flight.flown.exit_code == 1


def change() -> Any:
    return mavlink.MAVLink_param_set_message(1, 1, b"FS_GCS_ENABLE", 0.0, 9)


@pytest.mark.thorough
def test_a_changed_failsafe_parameter_is_told(tmp_path) -> None:
    flight = DryRun("ardupilot", tmp_path, deeds=[(WRONG, station(change(), seconds=0.1))])
    told = flight.only("foreign_command").fields["reason"]
    assert told.startswith("somebody set FS_GCS_ENABLE from 5 to 0")
    assert flight.flown.exit_code == 1


@pytest.mark.thorough
def test_where_others_may_command_it_the_run_may_succeed(tmp_path) -> None:
    deeds = [(WRONG, station(change(), seconds=0.1))]
    flight = DryRun("ardupilot", tmp_path, deeds=deeds, driver={"shared": True})
    assert flight.only("foreign_command")
    assert flight.flown.exit_code == 0


@thorough
@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_a_station_that_only_listens_is_no_commander(autopilot, tmp_path) -> None:
    flight = DryRun(autopilot, tmp_path, deeds=[(WRONG, station(seconds=2.0))])
    assert flight.events("foreign_command") == []
    assert flight.flown.exit_code == 0
