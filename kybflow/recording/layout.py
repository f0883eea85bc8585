"""What a message of a recording looks like, written once.

From it come the ROS 1 message definition that is stored in the file (and lets any tool read it),
the `struct` format that the recorder packs with, and the NumPy type that the report reads with. The
ROS 1 encoding of numbers and nested messages is their little-endian bytes in order, with nothing
between (https://wiki.ros.org/msg).
"""

from __future__ import annotations

from typing import Any

from kybflow.core.signals import NS, CommandKind, Event, SetpointKind
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts import AIR

PACKAGE = "kybflow"
EVENTS_TOPIC = "/events"
METADATA = "kybflow"

RATE = 50
"""How often a second, at most, each estimator is recorded, and the report reads a tick."""

SETPOINT_KINDS = {kind: number for number, kind in enumerate(SetpointKind, start=1)}
"""The number of each kind of setpoint in a recording; 0 says that there was no setpoint."""

COMMAND_KINDS = {kind: number for number, kind in enumerate(CommandKind, start=1)}
"""The number of each kind of command in a recording."""

SWITCHES = 32
"""How many switches of a transmitter are recorded."""

HAS_POSITION, HAS_VELOCITY, HAS_ACCELERATION, HAS_JERK, HAS_HEADING = 1, 2, 4, 8, 16

EVENT_SCHEMA = {
    "title": f"{PACKAGE}/Event",
    "type": "object",
    "properties": {
        "t_s": {"type": "number"},
        "event": {"type": "string"},
        "vehicle": {"type": "string"},
        "at": {"type": "string"},
        "fields": {"type": "object"},
    },
}

_KINDS = ", ".join(f"{number} {kind.value}" for kind, number in SETPOINT_KINDS.items())
_COMMANDS = ", ".join(f"{number} {kind.value}" for kind, number in COMMAND_KINDS.items())

# Each message: (type, name, comment) of its fields. Frames and units: `kybflow.core.signals`.
_MESSAGES: dict[str, tuple[tuple[str, str, str], ...]] = {
    "Vector": (("float64", "x", ""), ("float64", "y", ""), ("float64", "z", "")),
    "Quaternion": (
        ("float64", "w", "body to world"),
        ("float64", "x", ""),
        ("float64", "y", ""),
        ("float64", "z", ""),
    ),
    "Estimate": (
        ("bool", "present", "false: no estimator had an estimate, and the rest is zero"),
        ("Vector", "position", "m, world (ENU)"),
        ("Vector", "velocity", "m/s, world"),
        ("Quaternion", "attitude", ""),
        ("Vector", "angular_velocity", "rad/s, body (FLU)"),
        ("float64", "age", "s since the newest measurement in it was true"),
        ("float64", "spread", "m, standard deviation of the position"),
    ),
    "Setpoint": (
        ("uint8", "kind", f"0 none, {_KINDS}"),
        (
            "uint8",
            "present",
            "sum of 1 position, 2 velocity, 4 acceleration, 8 jerk, 16 heading; the rest is zero",
        ),
        ("Vector", "position", "m, world"),
        ("Vector", "velocity", "m/s, world"),
        ("Vector", "acceleration", "m/s^2, world"),
        ("Vector", "jerk", "m/s^3, world"),
        ("float64", "heading", "rad from east"),
        ("float64", "heading_rate", "rad/s"),
    ),
    "Command": (
        ("bool", "armed", "false: rotors stopped"),
        ("uint8", "kind", f"what of it counts: {_COMMANDS}; of the first three /NAME/command"),
        ("bool", "heading_present", "false: nobody knows the heading, and it is zero"),
        ("Quaternion", "attitude", ""),
        ("float64", "thrust", "N along body z"),
        ("Vector", "rates", "rad/s, body, fed forward"),
        ("float64", "heading", "rad from east"),
    ),
    "Truth": (
        ("bool", "present", "false: not simulated, and the rest is zero"),
        ("Vector", "position", "m, world"),
        ("Vector", "velocity", "m/s, world"),
        ("Quaternion", "attitude", ""),
        ("Vector", "angular_velocity", "rad/s, body"),
    ),
    "Tick": (
        ("Estimate", "estimate", "what the vehicle believed"),
        ("Setpoint", "wanted", "what the behavior asked for"),
        ("Setpoint", "setpoint", "what was left of it after the processors"),
        ("Command", "command", "what the driver was given"),
        ("Truth", "truth", "what the simulator knows"),
    ),
    "Candidate": (
        ("bool", "present", "false: it has no estimate, and the rest is that of none"),
        ("bool", "usable", "healthy, and its time is not used up"),
        ("bool", "used", "the vehicle flew on it"),
        ("Vector", "position", "m, world"),
        ("Quaternion", "attitude", ""),
        ("float64", "age", "s since the newest measurement in it was true"),
        ("float64", "spread", "m, standard deviation of the position"),
    ),
    "Pose": (
        ("int64", "time", "ns; when it was true. It arrived at the message's log time."),
        ("Vector", "position", "m, world"),
        ("Quaternion", "attitude", ""),
    ),
    "Battery": (
        ("int64", "time", "ns; when it was true. It arrived at the message's log time."),
        ("float64", "remaining", "0 to 1"),
        ("float64", "voltage", "V"),
    ),
    "Imu": (
        ("int64", "time", "ns; the end of what it is the average of"),
        ("float64", "dt", "s; how long that was"),
        ("Vector", "specific_force", "m/s^2, body (FLU)"),
        ("Vector", "angular_velocity", "rad/s, body"),
    ),
    "Position": (
        ("int64", "time", "ns; when it was true. It arrived at the message's log time."),
        ("Vector", "position", "m, world"),
        ("Vector", "spread", "m, standard deviation along each axis"),
    ),
    "Odometry": (
        ("int64", "time", "ns; when it was true. It arrived at the message's log time."),
        ("Vector", "position", "m, world"),
        ("Vector", "velocity", "m/s, world"),
        ("Quaternion", "attitude", ""),
        ("Vector", "angular_velocity", "rad/s, body"),
        ("float64", "spread", "m, standard deviation of the position"),
    ),
    "Sticks": (
        ("int64", "time", "ns; when it was true. It arrived at the message's log time."),
        ("float64", "roll", "-1 to 1, to the right"),
        ("float64", "pitch", "-1 to 1, forward"),
        ("float64", "yaw", "-1 to 1, to the left"),
        ("float64", "throttle", "0 to 1"),
        ("uint8", "count", "how many switches there are; the rest is zero"),
        (f"float64[{SWITCHES}]", "switches", "-1 to 1"),
    ),
    "Frame": (
        ("int64", "time", "ns; the middle of its exposure. It arrived at the message's log time."),
    ),
    "Payload": (
        ("int64", "time", "ns; when it was true. It arrived at the message's log time."),
        ("bool", "is_open", "the servo that holds the payload"),
        ("bool", "known", "false: the vehicle can't tell whether it is on board"),
        ("bool", "aboard", ""),
    ),
}

_PLAIN = {
    "float64": ("d", "<f8"),
    "int64": ("q", "<i8"),
    "uint8": ("B", "u1"),
    "bool": ("B", "?"),
    f"float64[{SWITCHES}]": (f"{SWITCHES}d", f"({SWITCHES},)<f8"),
}


def kept_every(control_rate: int) -> int:
    """Of how many ticks one is kept where so many a second are too many."""
    return max(1, control_rate // RATE)


def event_record(event: Event) -> dict[str, Any]:
    """An event as `/events` and events.jsonl hold it; `t_s` is seconds since the run began."""
    return {
        "t_s": event.time / NS,
        "event": event.name,
        "vehicle": event.vehicle,
        "at": event.at,
        "fields": event.fields,
    }


def head(plan: Plan) -> dict[str, Any]:
    """What a reader of the file needs to know of the mission; it stands in the file's metadata."""
    return {
        "mission": plan.mission,
        "summary": plan.summary,
        "target": plan.target,
        "simulated": plan.simulated,
        "control_rate": plan.control_rate,
        "fence": [plan.fence.low, plan.fence.high] if plan.fence else None,
        "vehicles": {v.name: _vehicle(v) for v in plan.vehicles},
    }


def _vehicle(vehicle: VehiclePlan) -> dict[str, Any]:
    return {
        "start": vehicle.start,
        "heading": vehicle.heading,
        "states": {
            state.name: {
                "built_in": state.built_in,
                "aloft": all(leg == (AIR, AIR) for leg in state.legs),
            }
            for state in vehicle.states.values()
        },
    }


def definition(message: str) -> bytes:
    """The ROS 1 message definition: its own fields, then each type that it is made of, behind a
    line of `=`."""
    texts = [_fields(message)]
    for name in _parts(message):
        texts.append(f"{'=' * 80}\nMSG: {PACKAGE}/{name}\n{_fields(name)}")
    return "".join(texts).encode()


def struct_format(message: str) -> str:
    """The format of `struct` that packs the message's numbers in order."""
    return "<" + _codes(message)


def dtype_spec(message: str) -> list[Any]:
    """What `numpy.dtype` makes the message's type of: vectors and quaternions are arrays of 3 and
    4."""
    spec: list[Any] = []
    for kind, name, _ in _MESSAGES[message]:
        if kind in _PLAIN:
            spec.append((name, _PLAIN[kind][1]))
        elif kind in ("Vector", "Quaternion"):
            spec.append((name, "<f8", (len(_MESSAGES[kind]),)))
        else:
            spec.append((name, dtype_spec(kind)))
    return spec


def _fields(message: str) -> str:
    lines = []
    for kind, name, comment in _MESSAGES[message]:
        lines.append(f"{kind} {name}  # {comment}" if comment else f"{kind} {name}")
    return "\n".join(lines) + "\n"


def _parts(message: str) -> list[str]:
    found: list[str] = []
    for kind, _, _ in _MESSAGES[message]:
        for name in [] if kind in _PLAIN else [kind, *_parts(kind)]:
            if name not in found:
                found.append(name)
    return found


def _codes(message: str) -> str:
    return "".join(
        _PLAIN[kind][0] if kind in _PLAIN else _codes(kind) for kind, _, _ in _MESSAGES[message]
    )
