"""Records a run into an MCAP file.

- `/NAME/tick`: one message per control tick (`kybflow.recording.layout`).
- `/NAME/KIND`: each measurement as it arrives. For a camera frame, `/NAME/frame/CAMERA` holds only
  its time. `pose`, `battery` and `imu` always exist, other topics from their first message on.
- `/NAME/wanted`: the behavior's setpoint, in ticks in which the tracker followed another one.
- `/NAME/command`: the setpoint of each command that has one.
- `/NAME/estimator/ESTIMATOR`: each estimator's estimate, at most 50 times a second.
- `/NAME/link`: what the link answered, as JSON, whenever it changes. `/NAME/located/ESTIMATOR`: the
  estimates of an estimator that uses images. `/NAME/true_payload`: where the simulator's payload
  is, whenever it moves. A replay (`kybflow.api.replay`) needs them.
- `/BODY/pose`: each pose of a moving obstacle or an object as it arrives. `/OBJECT/true` and
  `/contacts`: the simulator's objects and the forces on them, N, per control tick.
- `/events`: every event as JSON. `/obstacles`: the moving obstacles, 20 times a second.
- `/objects`: the objects as motion capture saw them and, in simulation, as they are, with the
  forces on them, 20 times a second.
- What viewers draw, in Foxglove's standard messages (`kybflow.recording.viewers`).

Log and publish times are the tick's time, so that two runs with the same seed give the same bytes.
docs/adr/0001-recording-encoding.md explains the encoding, docs/adr/0027-what-viewers-draw.md what
viewers draw.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from struct import Struct
from typing import Any, cast

from foxglove import Channel, Context, Schema, open_mcap
from foxglove.mcap import MCAPCompression, MCAPWriteOptions

from kybflow.core.geometry import Vec3
from kybflow.core.signals import (
    Battery,
    Command,
    CommandKind,
    Estimate,
    Event,
    Imu,
    Measurement,
    MeasurementKind,
    Pose,
    SeenObjects,
    SeenObstacles,
    Setpoint,
    SetpointKind,
    Time,
    Truth,
    kind_name,
)
from kybflow.dsl.plan import Plan
from kybflow.parts.link import Contact
from kybflow.recording.layout import (
    ANSWER_SCHEMA,
    COMMAND_KINDS,
    CONTACTS_SCHEMA,
    CONTACTS_TOPIC,
    EVENT_SCHEMA,
    EVENTS_TOPIC,
    HAS_ACCELERATION,
    HAS_HEADING,
    HAS_JERK,
    HAS_POSITION,
    HAS_VELOCITY,
    METADATA,
    OBJECTS_SCHEMA,
    OBJECTS_TOPIC,
    OBSTACLES_SCHEMA,
    OBSTACLES_TOPIC,
    PACKAGE,
    SETPOINT_KINDS,
    definition,
    event_record,
    head,
    kept_every,
    layout_of,
    objects_record,
    obstacles_record,
    struct_format,
)
from kybflow.recording.run_folder import GrowingFile
from kybflow.recording.viewers.channels import DrawnRun, DrawnVehicle, frame_every
from kybflow.runtime.events import EstimationState, VehicleObserver, WorldObserver
from kybflow.world.objects import ObjectState

CHUNK_SECONDS = 0.5
"""The most flight time in a chunk, s. The last chunk is lost if the program is killed."""

_TICK = Struct(struct_format("Tick"))
_pack_tick = _TICK.pack
_pack_setpoint = Struct(struct_format("Setpoint")).pack
_pack_vector = Struct(struct_format("Vector")).pack
_pack_estimate = Struct(struct_format("Estimate")).pack
_pack_candidate = Struct(struct_format("Candidate")).pack

_Message = str | MeasurementKind
_Log = Callable[[bytes, int], None]
_Measured = tuple[Callable[[Measurement], bytes], _Log | None]
"""The encoder for measurements of one kind, and the function that logs them; None if the kind has
several topics or an answer beside it."""

_LARGEST = (2.0 - 2.0**-23) * 2.0**127
"""The largest float32 number."""
_ZERO = (0.0, 0.0, 0.0)
_ZERO_4 = (0.0, 0.0, 0.0, 0.0)
_NO_ESTIMATE = Estimate(0, _ZERO, _ZERO, _ZERO_4, _ZERO, "", 0.0, 0.0)
_NO_SETPOINT = (0, 0, *_ZERO, *_ZERO, *_ZERO, *_ZERO, 0.0, 0.0)
_NO_TRUTH = Truth(_ZERO, _ZERO, _ZERO_4, _ZERO)

_ATTITUDE_THRUST = CommandKind.ATTITUDE_THRUST
_ATTITUDE_THRUST_NUMBER = COMMAND_KINDS[_ATTITUDE_THRUST]
_POSITION = SetpointKind.POSITION
_ALL = HAS_POSITION | HAS_VELOCITY | HAS_ACCELERATION | HAS_JERK | HAS_HEADING
_POSITION_NUMBER = SETPOINT_KINDS[_POSITION]


MOMENTS = frozenset(
    {"state", "state_after", "status_texts", "foreign_commands", "touch", "ignored", "failed"}
)
"""The answers that are recorded each time; all others are recorded when they change."""


class Recorder(WorldObserver):
    """The recording of a run. failed: why recording stopped, None while it works; no method raises
    for this. started: when the run began. Raises RunUnwritten if the file can't be opened."""

    def __init__(self, path: Path, plan: Plan, started: datetime | None = None) -> None:
        self._file = GrowingFile.of_run(path, "recording")
        self._context = Context()
        per_second = plan.control_rate * max(1, len(plan.vehicles)) * _TICK.size
        self._writer = open_mcap(
            self._file,  # type: ignore[arg-type]  # the SDK asks for write, seek and flush only
            context=self._context,
            writer_options=MCAPWriteOptions(
                compression=MCAPCompression.Lz4,
                chunk_size=int(per_second * CHUNK_SECONDS),
                disable_seeking=True,
                calculate_data_section_crc=False,
            ),
        )
        self._writer.write_metadata(METADATA, {"plan": json.dumps(head(plan, started))})
        self._events = Channel(EVENTS_TOPIC, schema=EVENT_SCHEMA, context=self._context)
        self._obstacles: Channel | None = None
        if plan.moving:
            self._obstacles = Channel(
                OBSTACLES_TOPIC, schema=OBSTACLES_SCHEMA, context=self._context
            )
        self._objects: Channel | None = None
        if plan.objects:
            self._objects = Channel(OBJECTS_TOPIC, schema=OBJECTS_SCHEMA, context=self._context)
        self._drawn = DrawnRun(plan, self._context)
        self._vehicles = {
            name: VehicleChannel(name, plan.control_rate, drawn, self._context)
            for name, drawn in self._drawn.vehicles.items()
        }
        self._bodies: dict[str, _Log] = {}
        self._contacts: _Log | None = None
        self._forces: Mapping[Contact, float] = {}
        self._closed = False

    @property
    def failed(self) -> str | None:
        return self._file.failed

    def check(self) -> None:
        """Check that the file still holds everything recorded."""
        self._file.check()

    def vehicle(self, name: str) -> VehicleChannel:
        return self._vehicles[name]

    def event(self, event: Event) -> None:
        record = event_record(event)
        self._events.base.log(json.dumps(record).encode(), event.time)
        self._drawn.event(event.time, record)

    def obstacles(self, now: Time, seen: SeenObstacles) -> None:
        if self._obstacles is not None:
            self._obstacles.base.log(json.dumps(obstacles_record(seen)).encode(), now)
            self._drawn.obstacles(now, seen)

    def body(self, now: Time, name: str, measurement: Measurement) -> None:
        self._body(f"/{name}/pose", Pose)(layout_of(Pose).packed(measurement), now)

    def objects(
        self, now: Time, states: Mapping[str, ObjectState], forces: Mapping[Contact, float]
    ) -> None:
        for name, state in states.items():
            kind: Any = ObjectState
            self._body(f"/{name}/true", kind)(layout_of(kind).packed(state), now)
        if forces != self._forces:
            self._forces = forces
            if self._contacts is None:
                self._contacts = _json_log(self._context, CONTACTS_TOPIC, CONTACTS_SCHEMA)
            felt = {"|".join(contact): force for contact, force in forces.items()}
            self._contacts(json.dumps(felt).encode(), now)

    def _body(self, topic: str, message: _Message) -> _Log:
        if topic not in self._bodies:
            self._bodies[topic] = _log(self._context, topic, message)
        return self._bodies[topic]

    def shown_objects(
        self,
        now: Time,
        true: Mapping[str, ObjectState],
        seen: SeenObjects,
        forces: Mapping[Contact, float],
        touching: Mapping[str, str],
    ) -> None:
        """Record the objects, with the arguments of `objects_record`."""
        if self._objects is not None:
            told = objects_record(true, seen, forces, touching)
            self._objects.base.log(json.dumps(told).encode(), now)
            self._drawn.objects(now, seen)

    def close(self) -> None:
        """Write pending data and the index, and close the file; may be called again."""
        if not self._closed:
            self._closed = True
            self._writer.close()
            self._file.close()


class VehicleChannel(VehicleObserver):
    """Records one vehicle. drawn: logs what viewers draw of it."""

    def __init__(self, name: str, control_rate: int, drawn: DrawnVehicle, context: Context) -> None:
        self._every, self._drawn_every = kept_every(control_rate), frame_every(control_rate)
        self._ticks, self._drawn = 0, drawn
        self._tick = _log(context, f"/{name}/tick", "Tick")
        self._name, self._context = name, context
        self._measured: dict[MeasurementKind, _Measured] = {
            Battery: (layout_of(Battery).packed, None)  # its warning is recorded as an answer
        }
        self._optional = {"battery": _log(context, f"/{name}/battery", Battery)}
        for kind in (Pose, Imu):
            self._open(kind)
        self._estimators: dict[str, _Log] = {}
        self._answers: dict[str, object] = {}
        self._link: _Log | None = None
        self._payload: Vec3 | None = None

    def tick(
        self,
        now: Time,
        estimate: Estimate | None,
        wanted: Setpoint | None,
        setpoint: Setpoint | None,
        command: Command,
        truth: Truth | None,
        estimation: EstimationState,
    ) -> None:
        """Record a control tick. wanted, setpoint: the setpoint before and after the processors."""
        believed: Any = estimate or _NO_ESTIMATE  # Any: mypyc would convert each number twice
        asked: Any = command
        true: Any = truth or _NO_TRUTH
        _, p, v, q, w, _, age, spread = believed
        attitude, thrust, rates, heading, armed, kind, sent = asked
        number = _ATTITUDE_THRUST_NUMBER if kind is _ATTITUDE_THRUST else COMMAND_KINDS[kind]
        pt, vt, qt, wt, payload = true
        values = (
            estimate is not None, *p, *v, *q, *w, age, spread,
            *_numbers(setpoint),
            armed, number, heading is not None, *attitude, thrust, *rates, heading or 0.0,
            truth is not None, *pt, *vt, *qt, *wt,
        )  # fmt: skip
        try:
            self._tick(_pack_tick(*values), now)
        except OverflowError:
            self._tick(_pack_tick(*map(_within_float32, values)), now)
        if payload is not None and payload != self._payload:
            self._payload = payload
            self._log_optional("true_payload", "Vector", _pack_vector(*payload), now)
        if wanted is not setpoint:
            self._setpoint("wanted", wanted, now)
        if sent is not None:
            self._setpoint("command", sent, now)
        if self._ticks % self._every == 0:
            self._candidates(now, estimation)
        if self._ticks % self._drawn_every == 0:
            self._drawn.draw(now, estimate, setpoint, truth)
        self._ticks += 1

    def _setpoint(self, topic: str, setpoint: Setpoint | None, now: Time) -> None:
        values = _numbers(setpoint)
        try:
            data = _pack_setpoint(*values)
        except OverflowError:
            data = _pack_setpoint(*map(_within_float32, values))
        self._log_optional(topic, "Setpoint", data, now)

    def _candidates(self, now: Time, estimation: EstimationState) -> None:
        source, logs = estimation.source, self._estimators
        for candidate in estimation.candidates:
            name, estimate = candidate.name, candidate.estimate
            if name not in logs:
                logs[name] = _log(self._context, f"/{self._name}/estimator/{name}", "Candidate")
            _, position, _, attitude, _, _, age, spread = estimate or _NO_ESTIMATE
            known, usable, used = estimate is not None, candidate.is_usable, name == source
            data = _pack_candidate(known, usable, used, *position, *attitude, age, spread)
            logs[name](data, now)

    def measurement(self, now: Time, measurement: Measurement) -> None:
        kind = type(measurement)
        packed, log = self._measured.get(kind) or self._open(kind)
        if log is None:
            if kind is Battery:
                self.answer(now, "battery_warning", cast(Battery, measurement).warning)
            topic = layout_of(kind).topic(measurement)
            self._log_optional(topic, kind, packed(measurement), now)
        else:
            log(packed(measurement), now)

    def answer(self, now: Time, of: str, value: object) -> None:
        if of not in MOMENTS:
            if self._answers.get(of) == value:
                return
            self._answers[of] = value
        if self._link is None:
            self._link = _json_log(self._context, f"/{self._name}/link", ANSWER_SCHEMA)
        self._link(json.dumps({of: value}, default=_plain).encode(), now)

    def located(self, now: Time, estimator: str, estimate: Estimate | None) -> None:
        _, p, v, q, w, _, age, spread = estimate or _NO_ESTIMATE
        data = _pack_estimate(estimate is not None, *p, *v, *q, *w, age, spread)
        self._log_optional(f"located/{estimator}", "Estimate", data, now)

    def _open(self, kind: MeasurementKind) -> _Measured:
        """Open the channel for a kind of measurement, unless the kind has several topics."""
        layout = layout_of(kind)
        log = None
        if not layout.has_topics:
            log = _log(self._context, f"/{self._name}/{kind_name(kind)}", kind)
        self._measured[kind] = layout.packed, log
        return layout.packed, log

    def _log_optional(self, topic: str, message: _Message, data: bytes, now: Time) -> None:
        """Log to a topic whose channel is opened with its first message."""
        if topic not in self._optional:
            self._optional[topic] = _log(self._context, f"/{self._name}/{topic}", message)
        self._optional[topic](data, now)


def _numbers(setpoint: Setpoint | None) -> Any:
    """Return a setpoint's kind, the sum of its present fields' marks, and all fields with zeros for
    absent ones."""
    if setpoint is None:
        return _NO_SETPOINT
    fields: Any = setpoint
    kind, position, velocity, acceleration, jerk, heading, rate, _ = fields
    if kind is _POSITION and position and velocity and acceleration and heading is not None:
        present = _ALL if jerk else _ALL - HAS_JERK
        return (
            _POSITION_NUMBER, present,
            *position, *velocity, *acceleration, *(jerk or _ZERO), heading, rate,
        )  # fmt: skip
    present = (
        HAS_POSITION * (position is not None)
        + HAS_VELOCITY * (velocity is not None)
        + HAS_ACCELERATION * (acceleration is not None)
        + HAS_JERK * (jerk is not None)
        + HAS_HEADING * (heading is not None)
    )
    return (
        SETPOINT_KINDS[kind], present,
        *(position or _ZERO), *(velocity or _ZERO), *(acceleration or _ZERO), *(jerk or _ZERO),
        heading or 0.0, rate,
    )  # fmt: skip


def _within_float32(value: Any) -> Any:
    """Return the nearest number that fits a float32, because a part's setpoint or command may be
    too large. Integers stay integers, also when compiled."""
    return max(-_LARGEST, min(value, _LARGEST))


def _plain(value: Any) -> object:
    """Return what JSON can hold of a value that a lab's own link answered, such as NumPy's bool."""
    return value.item() if hasattr(value, "item") else str(value)


def _json_log(context: Context, topic: str, schema: dict[str, Any]) -> _Log:
    return Channel(topic, schema=schema, context=context).base.log


def _log(context: Context, topic: str, message: _Message) -> _Log:
    name = message if isinstance(message, str) else message.__name__
    schema = Schema(name=f"{PACKAGE}/{name}", encoding="ros1msg", data=definition(message))
    channel = Channel(topic, message_encoding="ros1", schema=schema, context=context)
    return channel.base.log  # without the wrapper, which checks each message's type
