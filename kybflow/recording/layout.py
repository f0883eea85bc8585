"""The layout of a recording's messages.

For each message it gives the ROS 1 definition, by which any tool can read the file, the `struct`
format for the recorder, and the NumPy type for the report. ROS 1 encodes numbers and nested
messages as their little-endian bytes in order, without padding (https://wiki.ros.org/msg).
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from functools import cache
from itertools import chain, islice
from operator import itemgetter
from struct import Struct
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import (
    NS,
    CommandKind,
    Event,
    MeasurementKind,
    Recorded,
    SeenObjects,
    SeenObstacles,
    SetpointKind,
    kind_name,
)
from kybflow.core.units import ANGLE, LENGTH
from kybflow.dsl.expressions import tree
from kybflow.dsl.expressions.parse import FLIPPED
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.dsl.resolving.library_files import without_homes
from kybflow.parts import AIR
from kybflow.parts.link import Contact
from kybflow.parts.observables import OBJECT_OBSERVABLES
from kybflow.world.objects import (
    WORLD,
    ObjectState,
    Placement,
    corners,
    in_order,
    placements,
)

PACKAGE = "kybflow"
EVENTS_TOPIC = "/events"
OBSTACLES_TOPIC = "/obstacles"
OBJECTS_TOPIC = "/objects"
CONTACTS_TOPIC = "/contacts"
METADATA = "kybflow"

RATE = 50
"""The highest rate at which the recorder writes estimates and the report reads ticks, Hz."""

SETPOINT_KINDS = {kind: number for number, kind in enumerate(SetpointKind, start=1)}
"""The number of each kind of setpoint in a recording; 0 means no setpoint."""

COMMAND_KINDS = {kind: number for number, kind in enumerate(CommandKind, start=1)}
"""The number of each kind of command in a recording."""

SWITCHES = 32
"""The most switches of a transmitter that are recorded."""

HAS_POSITION, HAS_VELOCITY, HAS_ACCELERATION, HAS_JERK, HAS_HEADING = 1, 2, 4, 8, 16

EVENT_SCHEMA = {
    "title": f"{PACKAGE}/Event",
    "type": "object",
    "properties": {
        "t_s": {"type": "number"},
        **{key: {"type": "string"} for key in ("event", "vehicle", "at")},
        "fields": {"type": "object"},
    },
}

OBSTACLES_SCHEMA = {
    "title": f"{PACKAGE}/Obstacles",
    "type": "object",
    "additionalProperties": {
        "type": "object",
        "properties": {
            "seen_s": {"type": "number"},
            "position": {"type": "array", "items": {"type": "number"}},
            "radius": {"type": "number"},
        },
    },
}

ANSWER_SCHEMA = {"title": f"{PACKAGE}/Answer", "type": "object"}
CONTACTS_SCHEMA = {
    "title": f"{PACKAGE}/Contacts",
    "type": "object",
    "additionalProperties": {"type": "number"},
}

_STATE = {
    **{
        key: {"type": "array", "items": {"type": "number"}}
        for key in ("position", "attitude", "velocity")
    },
    "q": {"type": "number"},
    "speed": {"type": "number"},
}
OBJECTS_SCHEMA = {
    "title": f"{PACKAGE}/Objects",
    "type": "object",
    "additionalProperties": {
        "type": "object",
        "properties": {
            "true": {"type": "object", "properties": _STATE},
            "seen": {"type": "object", "properties": {"seen_s": {"type": "number"}, **_STATE}},
            "force_n": {"type": "object", "additionalProperties": {"type": "number"}},
            "touched_by": {"type": "array", "items": {"type": "string"}},
        },
    },
}

_KINDS = ", ".join(f"{number} {kind.value}" for kind, number in SETPOINT_KINDS.items())
_COMMANDS = ", ".join(f"{number} {kind.value}" for kind, number in COMMAND_KINDS.items())

_XYZ = (("float64", "x", ""), ("float64", "y", ""), ("float64", "z", ""))
_XYZ_32 = (("float32", "x", ""), ("float32", "y", ""), ("float32", "z", ""))
# Each message: (type, name, comment) of its fields. Frames and units: `kybflow.core.signals`.
_MESSAGES: dict[str, tuple[tuple[str, str, str], ...]] = {
    "Vector": _XYZ,
    "Vector32": _XYZ_32,
    "Quaternion": (("float64", "w", "body to world"), *_XYZ),
    "Quaternion32": (("float32", "w", "body to world"), *_XYZ_32),
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
        ("Vector32", "velocity", "m/s, world"),
        ("Vector32", "acceleration", "m/s^2, world"),
        ("Vector32", "jerk", "m/s^3, world"),
        ("float32", "heading", "rad from east"),
        ("float32", "heading_rate", "rad/s"),
    ),
    "Command": (
        ("bool", "armed", "false: rotors stopped"),
        ("uint8", "kind", f"what of it counts: {_COMMANDS}; of the first three /NAME/command"),
        ("bool", "heading_present", "false: nobody knows the heading, and it is zero"),
        ("Quaternion32", "attitude", ""),
        ("float32", "thrust", "N along body z"),
        ("Vector32", "rates", "rad/s, body, fed forward"),
        ("float32", "heading", "rad from east"),
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
        ("Setpoint", "setpoint", "what was followed; if not what was asked for, see /NAME/wanted"),
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
}

PLAIN = {
    "float64": ("d", "<f8"),
    "float32": ("f", "<f4"),
    "int64": ("q", "<i8"),
    "uint8": ("B", "u1"),
    "bool": ("?", "?"),
    f"float64[{SWITCHES}]": (f"{SWITCHES}d", f"({SWITCHES},)<f8"),
}
"""The `struct` format and the NumPy type of each plain type."""

_ARRAYS = {
    "Vector": ("<f8", (3,)),
    "Vector32": ("<f4", (3,)),
    "Quaternion": ("<f8", (4,)),
    "Quaternion32": ("<f4", (4,)),
}


def kept_every(control_rate: int) -> int:
    """Return n such that every n-th tick makes at most about `RATE` per second."""
    return max(1, control_rate // RATE)


def event_record(event: Event) -> dict[str, Any]:
    """Return an event as written to `/events` and `events.jsonl`; `t_s` is in seconds since the
    start."""
    return {
        "t_s": event.time / NS,
        "event": event.name,
        "vehicle": event.vehicle,
        "at": without_homes(event.at),
        "fields": event.fields,
    }


def obstacles_record(seen: SeenObstacles) -> dict[str, Any]:
    """Return the moving obstacles as written to `/obstacles`, by name: when each was last seen, in
    seconds since the start, its position (world) and radius in metres."""
    return {
        name: {"seen_s": one.time / NS, "position": one.position, "radius": one.radius}
        for name, one in seen.items()
    }


def objects_record(
    true: Mapping[str, ObjectState],
    seen: SeenObjects,
    forces: Mapping[Contact, float],
    touching: Mapping[str, str],
) -> dict[str, Any]:
    """Return the objects as written to `/objects`, by name: their `true` states in simulation, and
    the states that motion capture has `seen`, with the time in seconds since the start. A state is
    pose and velocity (world; metres, quaternion w x y z), the joint's coordinate and its rate.

    forces: those with which vehicles press surfaces, by `VEHICLE.SURFACE`, in simulation. touching:
    the object that each vehicle touches by its own inference, by vehicle.
    """
    found: dict[str, dict[str, Any]] = {
        name: {"force_n": {}, "touched_by": []} for name in (*true, *seen, *touching.values())
    }
    for name, state in true.items():
        found[name]["true"] = state._asdict()
    for name, one in seen.items():
        kept = one._asdict()
        found[name]["seen"] = {"seen_s": kept.pop("time") / NS, **kept}
    for (vehicle, name, surface), force in forces.items():
        found[name]["force_n"][f"{vehicle}.{surface}"] = round(force, 4)
    for vehicle, name in touching.items():
        found[name]["touched_by"].append(vehicle)
    return found


def head(plan: Plan, started: datetime | None = None) -> dict[str, Any]:
    """Return the metadata of a recording: the facts about the mission that its readers need.

    started: when the run began, by the machine's clock. A simulated run leaves it out, so that the
    same seed gives the same bytes.
    """
    objects = _objects(plan)
    return {
        "mission": plan.mission,
        "summary": plan.summary,
        "target": plan.target,
        "simulated": plan.simulated,
        **({} if started is None or plan.simulated else {"started": started.isoformat()}),
        "control_rate": plan.control_rate,
        "fence": [plan.fence.low, plan.fence.high] if plan.fence else None,
        "vehicles": {v.name: _vehicle(v, plan) for v in plan.vehicles},
        **({"objects": objects} if objects else {}),
    }


def _objects(plan: Plan) -> dict[str, Any]:
    """Return the facts about each object that moves by itself, by name.

    coordinates: those to show, by their names in conditions: those of its joint and those with
    goals; a yaw with goals stands for the angle. boxes: the corners of its box, its plates and
    those of its parts, in its axes. stops: its pose at each stop of its joint, with what it is on
    at the start. goals: texts and values by coordinate.
    """
    found: dict[str, Any] = {}
    movers: dict[str | None, tuple[str, Placement]] = {}
    for one in in_order(plan.objects.values()):
        if one.moves:
            stops = () if one.joint is None else (one.joint.low, one.joint.high)
            goals = _goals(plan, one.name)
            own = [k for k, o in OBJECT_OBSERVABLES.items() if o.of_joint and o.has(one)]
            own = [k for k in own or ("x", "y", "yaw") if k != "angle" or "yaw" not in goals]
            found[one.name] = {
                "coordinates": [*dict.fromkeys((*own, *goals))],
                "boxes": [*corners(one, WORLD)],
                "stops": [placements(plan.objects, {one.name: q})[one.name] for q in stops],
                "goals": goals,
            }
            movers[one.name] = one.name, WORLD
        else:
            mover, below = movers[one.on]
            movers[one.name] = mover, one.placed(below, 0.0)
            found[mover]["boxes"] += corners(one, movers[one.name][1])
    return {name: found[name] for name in plan.objects if name in found}


def _goals(plan: Plan, name: str) -> dict[str, dict[str, float]]:
    """Return the goals of an object's coordinates, by text: those of coordinators, and the numbers
    with which expectations compare them."""
    found: dict[str, dict[str, float]] = {}
    coordinators = (p.coordinator for flow in plan.flows for p in flow.phases.values())
    for use in filter(None, coordinators):
        for of, key, value in use.cls.goals(use.params, plan.objects):
            if of == name:
                found.setdefault(key, {})[f"goal of {use.name}"] = value
    waiting: list[tree.Expression] = [one.expression for one in plan.expectations]
    for one in waiting:
        match one:
            case tree.Always(part) | tree.Eventually(part) | tree.Finally(part):
                waiting.append(part)
            case tree.And(parts) | tree.Or(parts):
                waiting += parts
            case tree.Compare(operator, tree.Quantity() as bound, tree.ObjectRead() as read):
                waiting.append(tree.Compare(FLIPPED[operator], read, bound))
            case tree.Compare(operator, tree.ObjectRead(of, key), tree.Quantity(value) as bound):
                if of == name and OBJECT_OBSERVABLES[key].dimension in (LENGTH, ANGLE):
                    text = f"expected {operator} {tree.shown_value(bound)}"
                    found.setdefault(key, {})[text] = value
    return found


def _vehicle(vehicle: VehiclePlan, plan: Plan) -> dict[str, Any]:
    others = {v.name: v.airframe.diameter for v in plan.vehicles if v.name != vehicle.name}
    own, supervisors = vehicle.airframe.diameter, vehicle.supervisors
    return {
        "start": vehicle.start,
        "heading": vehicle.heading,
        # metres below which a supervisor alarms at the start; 0 if none does
        "keeps_apart": {
            name: max((s.cls.keeps_apart(s.params, own, size) for s in supervisors), default=0.0)
            for name, size in others.items()
        },
        "states": {
            state.name: {
                "built_in": state.built_in,
                "aloft": all(leg == (AIR, AIR) for leg in state.legs),
                "hears": state.behavior.cls.hears,
            }
            for state in vehicle.states.values()
        },
    }


class MeasurementLayout:
    """The message of one kind of measurement, derived from the annotations of its class
    (`kybflow.core.signals.Measurement`).

    message, fields: the message's name and fields. packed: encodes a measurement. kind: the class
    of the measurement. Raises TypeError for a field that can't be recorded.
    """

    def __init__(self, kind: MeasurementKind) -> None:
        self.kind: Any = kind
        self.message, self._topic = kind.__name__, kind_name(kind)
        self.fields: tuple[_Field, ...] = ()
        self._keys: list[int] = []
        pieces: list[_Piece] = []
        self._readers: list[_Reader] = []
        for index, (name, hint) in enumerate(get_type_hints(kind, include_extras=True).items()):
            plain, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
            if plain is str:
                self._keys.append(index)
            if plain is str or plain is Any:
                self._readers.append(lambda _: None)
                continue
            fields, piece, reader = _recorded(name, plain, notes[-1] if notes else "", index)
            self.fields += fields
            pieces.append(piece)
            self._readers.append(reader)
        self._struct = Struct("<" + _codes(self.fields))
        self.packed = _packed(self._struct, pieces, index + 1)

    def unpacked(self, content: bytes | bytearray) -> Iterator[Any]:
        """Decode measurements, one after the other; fields that aren't recorded are None."""
        for numbers in self._struct.iter_unpack(content):
            left = iter(numbers)
            yield self.kind(*(read(left) for read in self._readers))

    def topic(self, measurement: Any) -> str:
        """Return the topic relative to the vehicle's; for frames it contains the camera."""
        return "/".join((self._topic, *(measurement[key] for key in self._keys)))

    @property
    def has_topics(self) -> bool:
        return bool(self._keys)


_Field = tuple[str, str, str]
_Piece = int | slice | Callable[[Any], tuple[float, ...]]
"""How to take the numbers of a field from a measurement: an index, a slice or a function."""
_Reader = Callable[[Iterator[Any]], Any]
"""Takes the value of a field from the numbers of a message."""
_flat = chain.from_iterable
_SCALARS = {int: "int64", float: "float64", bool: "bool"}
_TUPLES = {Vec3: "Vector", Quat: "Quaternion"}


def _packed(struct: Struct, pieces: list[_Piece], width: int) -> Callable[[Any], bytes]:
    """Return the function that encodes a measurement of `width` fields. It is fast if no field
    needs a function call, and fastest if it records all fields and the vectors come last."""
    pack = struct.pack
    if any(map(callable, pieces)):
        return lambda m: pack(*_flat(p(m) if callable(p) else m[p] for p in pieces))
    scalars = sum(isinstance(p, slice) for p in pieces)
    if pieces[scalars:] == [*range(scalars, width)]:
        return lambda m: pack(*m[:scalars], *_flat(m[scalars:]))
    items = itemgetter(*(p for p in pieces if not callable(p)), slice(0, 0))
    return lambda m: pack(*_flat(items(m)))


def _recorded(
    name: str, plain: Any, note: Any, index: int
) -> tuple[tuple[_Field, ...], _Piece, _Reader]:
    """Return the message fields for one field of a measurement, how to take their numbers, and how
    to read its value from them."""
    if plain in _SCALARS:
        return ((_SCALARS[plain], name, note),), slice(index, index + 1), next
    if plain in _TUPLES:
        width = len(_MESSAGES[_TUPLES[plain]])
        return ((_TUPLES[plain], name, note),), index, lambda left: tuple(islice(left, width))
    if isinstance(note, Recorded):
        if get_origin(plain) in (Union, types.UnionType):
            scalar = next(_SCALARS[t] for t in get_args(plain) if t in _SCALARS)
            extra = ("bool", note.extra, note.extra_comment)
            field = extra, (scalar, name, note.comment)

            def optional(left: Iterator[Any]) -> Any:
                known, value = islice(left, 2)
                return value if known else None

            return field, lambda values: (values[index] is not None, values[index] or 0), optional
        if plain == tuple[float, ...]:
            extra = ("uint8", note.extra, note.extra_comment)

            def numbers(values: Any) -> tuple[float, ...]:
                held = values[index][:SWITCHES]
                return (len(held), *held, *(0.0,) * (SWITCHES - len(held)))

            def counted(left: Iterator[Any]) -> tuple[float, ...]:
                count, *held = islice(left, SWITCHES + 1)
                return tuple(held[:count])

            return (extra, (f"float64[{SWITCHES}]", name, note.comment)), numbers, counted
    raise TypeError(f"`{name}: {plain}` can't be recorded")


@cache
def layout_of(kind: MeasurementKind) -> MeasurementLayout:
    return MeasurementLayout(kind)


def _fields_of(message: str | MeasurementKind) -> tuple[_Field, ...]:
    return _MESSAGES[message] if isinstance(message, str) else layout_of(message).fields


def definition(message: str | MeasurementKind) -> bytes:
    """Return the ROS 1 message definition: the message's fields, then each nested message after a
    line of `=`."""
    fields = _fields_of(message)
    texts = [_text(fields)]
    for name in _parts(fields):
        texts.append(f"{'=' * 80}\nMSG: {PACKAGE}/{name}\n{_text(_MESSAGES[name])}")
    return "".join(texts).encode()


def struct_format(message: str | MeasurementKind) -> str:
    """Return the `struct` format of a message."""
    return "<" + _codes(_fields_of(message))


def dtype_spec(message: str | MeasurementKind) -> list[Any]:
    """Return the argument of `numpy.dtype` for a message. Vectors and quaternions become arrays."""
    spec: list[Any] = []
    for kind, name, _ in _fields_of(message):
        if kind in PLAIN:
            spec.append((name, PLAIN[kind][1]))
        elif kind in _ARRAYS:
            spec.append((name, *_ARRAYS[kind]))
        else:
            spec.append((name, dtype_spec(kind)))
    return spec


def _text(fields: tuple[_Field, ...]) -> str:
    lines = []
    for kind, name, comment in fields:
        lines.append(f"{kind} {name}  # {comment}" if comment else f"{kind} {name}")
    return "\n".join(lines) + "\n"


def _parts(fields: tuple[_Field, ...]) -> list[str]:
    found: list[str] = []
    for kind, _, _ in fields:
        for name in [] if kind in PLAIN else [kind, *_parts(_MESSAGES[kind])]:
            if name not in found:
                found.append(name)
    return found


def _codes(fields: tuple[_Field, ...]) -> str:
    return "".join(
        PLAIN[kind][0] if kind in PLAIN else _codes(_MESSAGES[kind]) for kind, _, _ in fields
    )
