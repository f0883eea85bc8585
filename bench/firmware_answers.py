"""What a firmware answers to one script of questions, for the table that the emulators are held to.

    python bench/firmware_answers.py px4 udpin:127.0.0.1:14540 [--station udpin:127.0.0.1:14550]
    python bench/firmware_answers.py ardupilot tcp:127.0.0.1:5760

The vehicle needs its own GPS, the firmware's default parameters and a few minutes of real time: it
takes off, flies some metres and returns. Never ask a real vehicle. The answers are printed as YAML,
for `tests/drivers/emulated_autopilot/firmware_answers.yaml`; the test beside that file asks the
emulated autopilots in lockstep. `kybflow emulate autopilot --factory` can be asked as well.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from math import atan2, cos, hypot, nan
from time import monotonic, sleep
from typing import Any

import yaml

from kybflow.drivers.mavlink.protocol.framing import Packer, Parser, mavlink
from kybflow.drivers.mavlink.transport.router import heartbeat
from kybflow.drivers.mavlink.transport.sockets import open_wire

STATION, COMPONENT = 255, 190
STREAMS = (27, 105, 108, 141, 193, 230, 331, 436)
"""RAW_IMU, HIGHRES_IMU, SIM_STATE, ALTITUDE, EKF_STATUS_REPORT, ESTIMATOR_STATUS, ODOMETRY and
CURRENT_MODE."""
POSITION, NEAR = 0xDF8, 0.3
"""The type mask of a position alone, and the distance at which it is reached, metres."""
SPEED = {"px4": "MPC_XY_VEL_MAX", "ardupilot": "WPNAV_SPEED"}
MISSION = {"px4": (1, 4, 4), "ardupilot": (1, 3, 0)}
OFFBOARD = {"px4": (1, 6, 0), "ardupilot": (1, 4, 0)}
RETURN = {"px4": (1, 4, 5), "ardupilot": (1, 6, 0)}
ROOM = {"px4": 4.0, "ardupilot": 1.0}
"""How far from home a return begins, metres."""


class Client:
    """A ground station. step: lets time pass and returns the messages that came. clock: seconds.
    send: sends a message."""

    def __init__(
        self,
        send: Callable[[Any], None],
        step: Callable[[], list[Any]],
        clock: Callable[[], float],
    ) -> None:
        self.send, self._step, self.clock = send, step, clock
        self.heard: list[Any] = []
        self.newest: dict[str, Any] = {}

    def run(self, seconds: float, until: Callable[[], Any] = lambda: None) -> float:
        """Let time pass until `until` is true; return the seconds, or nan if it never was."""
        begun = self.clock()
        while self.clock() - begun < seconds:
            for message in self._step():
                self.heard.append(message)
                self.newest[message.get_type()] = message
            if until():
                return self.clock() - begun
        return nan

    def after(self, message: Any, *kinds: str, seconds: float = 2.0) -> Any:
        """Send a message; return the first answer of these kinds, or None."""
        count = len(self.heard)
        self.send(message)

        def found() -> Any:
            return next((m for m in self.heard[count:] if m.get_type() in kinds), None)

        self.run(seconds, found)
        return found()

    def command(self, number: int, *p: float, component: int = 1) -> str:
        """Return the result of a COMMAND_LONG; `nothing` without an acknowledgement."""
        values = (*p, *[0.0] * (7 - len(p)))
        message = mavlink.MAVLink_command_long_message(1, component, number, 0, *values)
        ack = self.after(message, "COMMAND_ACK")
        if ack is None:
            return "nothing"
        return str(mavlink.enums["MAV_RESULT"][ack.result].name.removeprefix("MAV_RESULT_"))

    @property
    def armed(self) -> bool:
        beat = self.newest.get("HEARTBEAT")
        return beat is not None and bool(beat.base_mode & 128)

    @property
    def place(self) -> tuple[float, float, float]:
        """North, east and up, metres."""
        m = self.newest["LOCAL_POSITION_NED"]
        return m.x, m.y, -m.z

    def texts(self, since: int) -> str:
        said = (m.text for m in self.heard[since:] if m.get_type() == "STATUSTEXT")
        return " ".join(said)


def on_ground(client: Client, firmware: str) -> Iterator[tuple[str, Any]]:
    """Ask what can be asked before arming."""
    arm, request = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_REQUEST_MESSAGE
    result = client.command(arm, 2)
    client.run(1.5)
    yield "arm with param1 = 2", f"{result}, {'armed' if client.armed else 'not armed'}"
    yield "pause before arming", client.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    yield "capabilities", client.command(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1)
    yield "loiter", client.command(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
    for number in STREAMS:
        name = mavlink.mavlink_map[number].msgname
        result = client.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6)
        yield f"stream {name}", result
        client.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, -1)
    for component in (100, 190):
        yield f"command to component {component}", client.command(request, 0, component=component)
    yield "ping", _kind(client.after(mavlink.MAVLink_ping_message(0, 7, 0, 0), "PING"))
    read = mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH_PARAM", -1)
    yield "unknown parameter", _kind(client.after(read, "PARAM_ERROR", "PARAM_VALUE"))
    name = SPEED[firmware].encode()
    read = mavlink.MAVLink_param_request_read_message(1, 1, name, -1)
    value = client.after(read, "PARAM_VALUE").param_value
    written = mavlink.MAVLink_param_set_message(1, 1, name, value, 6)
    answer = client.after(written, "PARAM_ERROR", "PARAM_VALUE")
    yield "float parameter as INT32", _kind(answer)


def _kind(message: Any) -> str:
    if message is None:
        return "nothing"
    error = f" {message.error}" if message.get_type() == "PARAM_ERROR" else ""
    return str(message.get_type()) + error


def in_flight(client: Client, firmware: str) -> Iterator[tuple[str, Any]]:
    """Take off, and ask what can be asked in the air. Ends on the way home."""
    is_px4 = firmware == "px4"
    mode = mavlink.MAV_CMD_DO_SET_MODE
    for name, rate in (("LOCAL_POSITION_NED", 20), ("ATTITUDE", 20), ("EXTENDED_SYS_STATE", 5)):
        number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
        client.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rate)
    if not is_px4:
        since = len(client.heard)
        client.command(mode, *OFFBOARD[firmware])
        refused = client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        client.run(1.0)
        word = "RC not found"
        said = f"{refused}, {word}" if word in client.texts(since) else refused
        yield "arm by default, without a transmitter", said
        client.after(
            mavlink.MAVLink_param_set_message(1, 1, b"FS_THR_ENABLE", 0.0, 2), "PARAM_VALUE"
        )
    for _ in range(60):
        if client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == "ACCEPTED":
            break
        client.run(1.0)
    ground = client.place[2]
    height = 2.0
    if is_px4:
        client.after(
            mavlink.MAVLink_command_long_message(
                1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, 33, 0, 0, 0, 0, 0, 0
            ),
            "GLOBAL_POSITION_INT",
        )
        height += client.newest["GLOBAL_POSITION_INT"].alt / 1e3
    client.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan if is_px4 else 0, nan, nan, height)
    taken = client.run(20.0, lambda: client.place[2] - ground > 2.0 - NEAR)
    yield "seconds to 2 m", round(taken, 1)
    client.run(6.0)
    yield "mission mode without a mission", client.command(mode, *MISSION[firmware])
    yield "pause in flight", client.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    here = client.place
    yield from _go(client, firmware, (here[0] + 3.0, here[1], here[2]))
    away = ROOM[firmware]
    for _ in _go(client, firmware, (here[0] + away, here[1], here[2])):
        pass
    highest, states = client.place[2], set()
    client.command(mode, *RETURN[firmware])

    def looks() -> None:
        nonlocal highest
        highest = max(highest, client.place[2])
        if "EXTENDED_SYS_STATE" in client.newest:
            states.add(client.newest["EXTENDED_SYS_STATE"].landed_state)

    client.run(35.0, looks)
    yield f"highest in a return from {away:g} m away", round(highest - ground, 1)
    if not is_px4:
        yield "a return counts as landing", 4 in states
    client.run(60.0, lambda: not client.armed)


def _go(client: Client, firmware: str, to: tuple[float, float, float]) -> Iterator[tuple[str, Any]]:
    """Send the vehicle to a place by a position alone: how long, how fast, looking where."""
    x, y, z = to
    n, e, _ = client.place
    target = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, POSITION, x, y, -z, *[0.0] * 8
    )
    bearing, fastest, sent = atan2(y - e, x - n), 0.0, -1.0
    here = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, POSITION, n, e, -z, *[0.0] * 8
    )
    goal = here

    def there() -> bool:
        nonlocal fastest, sent
        if client.clock() - sent > 0.05:
            sent = client.clock()
            client.send(goal)
        m = client.newest["LOCAL_POSITION_NED"]
        fastest = max(fastest, hypot(m.vx, m.vy))
        return goal is target and hypot(m.x - x, m.y - y) < NEAR

    client.run(1.5, there)
    client.command(mavlink.MAV_CMD_DO_SET_MODE, *OFFBOARD[firmware])
    client.run(1.5, there)
    goal, fastest = target, 0.0
    taken = client.run(20.0, there)
    yield "seconds to 3 m away", round(taken, 1)
    yield "fastest on the way, m/s", round(fastest, 1)
    client.run(3.0, lambda: there() and None)
    off = client.newest["ATTITUDE"].yaw - bearing
    if firmware == "ardupilot":  # the other one keeps its heading, whatever that is
        yield "looks towards the target", bool(cos(off) > 0.9)


def answers(client: Client, firmware: str) -> dict[str, Any]:
    """Return all answers, by question."""
    found = dict(on_ground(client, firmware))
    if firmware == "ardupilot":  # the command to loiter has changed its mode
        client.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 0)
    return found | dict(in_flight(client, firmware))


def real(address: str) -> Client:
    """Return a client of a firmware at an address, in real time."""
    wire, parser, packer = open_wire(address), Parser(None), Packer(STATION, None)
    beat = -1.0
    peer: Any = None

    def send(message: Any) -> None:
        wire.send(packer.pack(message, COMPONENT), peer)

    def step() -> list[Any]:
        nonlocal beat, peer
        if monotonic() - beat > 1.0:
            beat = monotonic()
            send(heartbeat(mavlink.MAV_TYPE_GCS))
        sleep(0.005)
        messages: list[Any] = []
        for data, sender in wire.receive(round(1e9 * monotonic())):
            peer = sender
            messages += [m for m in parser.parse(data) if m.get_srcSystem() == 1]
        return messages

    return Client(send, step, monotonic)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("firmware", choices=("px4", "ardupilot"))
    parser.add_argument("address")
    parser.add_argument("--station", help="also list what comes to this ground station's address")
    o = parser.parse_args()
    client = real(o.address)
    client.run(60.0, lambda: "HEARTBEAT" in client.newest)
    client.run(45.0 if o.firmware == "ardupilot" else 15.0)
    client.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148)
    found = answers(client, o.firmware)
    if o.station:
        station = real(o.station)
        station.run(5.0)
        kinds = {m.get_type() for m in station.heard}
        found["ground station's link has"] = sorted(
            kinds & {"ATTITUDE", "HIGHRES_IMU", "LOCAL_POSITION_NED", "ODOMETRY"}
        )
    said = client.newest.get("AUTOPILOT_VERSION")
    version = 0 if said is None else said.flight_sw_version
    number = ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8))
    print(yaml.safe_dump({o.firmware: {"version": number, "answers": found}}, sort_keys=False))


if __name__ == "__main__":
    main()
