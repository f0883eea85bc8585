"""MAVSDK takes an emulated autopilot for a real one: it connects, arms, flies and lands."""

from __future__ import annotations

import asyncio
import warnings

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # the package tells that it was renamed
    mavsdk = pytest.importorskip("mavsdk", reason="mavsdk is not installed: pip install 'mavsdk<4'")
if not hasattr(mavsdk, "System"):
    pytest.skip("this mavsdk has no System: pip install 'mavsdk<4'", allow_module_level=True)

from mavsdk.offboard import PositionNedYaw
from served_autopilots import emulated
from waiting import HANGS, free_port

pytestmark = [pytest.mark.peer, pytest.mark.filterwarnings("ignore")]


def fly(port, flight):
    """Connect to an autopilot that speaks to `port`, and fly."""

    async def connected():
        drone = mavsdk.System(port=free_port())
        await drone.connect(system_address=f"udpin://127.0.0.1:{port}")
        await first(drone.core.connection_state(), lambda state: state.is_connected)
        await flight(drone)

    asyncio.run(asyncio.wait_for(connected(), HANGS))


async def first(stream, is_wanted):
    """The first of a stream that is wanted."""
    async for value in stream:
        if is_wanted(value):
            return value
    raise AssertionError("the stream ended")


def is_high(position):
    return position.relative_altitude_m > 1.7


async def land(drone):
    await drone.action.land()
    await first(drone.telemetry.armed(), lambda armed: not armed)


def test_px4_arms_takes_off_is_flown_offboard_and_lands():
    async def flight(drone):
        health = drone.telemetry.health()
        await first(health, lambda h: h.is_armable and h.is_home_position_ok)
        await drone.action.set_takeoff_altitude(2.0)
        await drone.action.arm()
        await drone.action.takeoff()
        await first(drone.telemetry.position(), is_high)
        await drone.offboard.set_position_ned(PositionNedYaw(1.0, 0.5, -2.5, 0.0))
        await drone.offboard.start()
        telemetry = drone.telemetry.position_velocity_ned()
        await first(telemetry, lambda p: p.position.north_m > 0.8 and p.position.down_m < -2.3)
        await drone.offboard.stop()
        await land(drone)

    port = free_port()
    with emulated("--vehicle", "px4", "--address", f"udpout:127.0.0.1:{port}"):
        fly(port, flight)


def test_ardupilot_arms_takes_off_and_lands():
    async def flight(drone):
        await drone.telemetry.set_rate_position(10.0)  # it streams nothing unasked
        await first(drone.telemetry.position(), lambda p: abs(p.relative_altitude_m) < 0.5)
        await drone.action.set_takeoff_altitude(2.0)
        await drone.action.arm()
        await drone.action.takeoff()
        await first(drone.telemetry.position(), is_high)
        await land(drone)

    port = free_port()
    with emulated("--vehicle", "ardupilot", "--address", f"udpout:127.0.0.1:{port}"):
        fly(port, flight)
