"""The mission as written, typed, with a span on everything: what `shape` makes, `check` judges and
`lower` turns into a plan. Names are still names; quantities are SI; `like`, imports and parameters
are gone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.files import File
from kybflow.core.geometry import Vec3
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.plan import Cause
from kybflow.dsl.reading.nodes import Mapping
from kybflow.parts import Footprint
from kybflow.parts.observables import chains_of
from kybflow.world.cameras import Camera
from kybflow.world.moving_sphere import MovingSphere
from kybflow.world.shapes import Box, Shape
from kybflow.world.tags import Tag
from kybflow.world.vehicle_context import Airframe, Parcel

if TYPE_CHECKING:
    from kybflow.parts.catalog import PartSpec


@dataclass(frozen=True, slots=True)
class PartUse:
    """A part in its place: `{use: fence, margin: 20 cm}`. `spans` holds the span of each parameter
    that was written."""

    name: Text
    spec: PartSpec
    params: Any
    label: str
    span: Span
    spans: dict[str, Span] = field(default_factory=dict)


class TransitionEntry(NamedTuple):
    """One transition as written. `span` is the whole of it, `target.span` the name of its target.
    `since` names the chain that the transition belongs to: its `after` counts from the entry of
    that chain. In a phase it names the flow, whose way out of every phase this is. `enters` names
    the chain that the transition enters; the target is then its first state. `emit` is the event
    that it tells."""

    cause: Cause
    target: Text
    span: Span
    when: Text | None = None
    event: Text | None = None
    after: float | None = None
    hold: float = 0.0
    since: str = ""
    enters: str = ""
    emit: Text | None = None


@dataclass(frozen=True, slots=True)
class StateEntry:
    """One entry of `behaviors:`. `inherited` is true when it came through `like`."""

    name: Text
    part: PartUse
    transitions: tuple[TransitionEntry, ...]
    span: Span
    inherited: bool = False
    estimators: tuple[Text, ...] = ()
    _footprints: dict[Vec3 | None, Footprint | None] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    def footprint(self, entry: Vec3 | None) -> Footprint | None:
        """Where the behavior goes from `entry`; several checks ask for the same."""
        if entry not in self._footprints:
            self._footprints[entry] = self.part.spec.cls.footprint(self.part.params, entry)
        return self._footprints[entry]


@dataclass(frozen=True, slots=True)
class ChainEntry:
    """A behavior that is a chain of states, `NAME.INNER`. Its transitions are also among those of
    every state inside."""

    name: Text
    transitions: tuple[TransitionEntry, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class EstimatorEntry:
    part: PartUse
    healthy: Text | None
    recover_after: float
    for_at_most: float | None


@dataclass(frozen=True, slots=True)
class CameraEntry:
    """One entry of an airframe's `cameras`: its parameters as declared, and the camera."""

    name: Text
    params: Any
    camera: Camera
    span: Span
    spans: dict[str, Span] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SensorEntry:
    """One sensor of a vehicle on the target. `estimator` names the estimator that it stands under,
    empty for a sensor that the driver brings; `index` is its place in that estimator's list."""

    estimator: Text
    part: PartUse
    index: int = 0

    @property
    def label(self) -> str:
        """The sensor's name in options: `fusion`, then `fusion.1`."""
        name = self.estimator.text or self.part.label
        return f"{name}.{self.index}" if self.index else name


@dataclass(frozen=True, slots=True)
class VehicleEntry:
    """One vehicle. `begin` is the name of the first state: the one written, else the first
    behavior. `airframe_spans` holds the span of each of the airframe's parameters that was
    written, `spans` that of each of the vehicle's own keys and of its start's `heading`. Callbacks
    and flows may request the states `requested` at any time; flows request `requested_first` while
    the vehicle waits on the ground at its start. `own_tracker` is the mission's, where the target
    has `tracker` in its place."""

    name: Text
    airframe: Airframe
    start: Vec3
    start_span: Span
    heading: float
    estimators: tuple[EstimatorEntry, ...]
    processors: tuple[PartUse, ...]
    tracker: PartUse
    supervisors: tuple[PartUse, ...]
    driver: PartUse
    begin: Text
    states: dict[str, StateEntry]
    span: Span
    airframe_spans: dict[str, Span] = field(default_factory=dict)
    home: Vec3 | None = None
    home_span: Span | None = None
    spans: dict[str, Span] = field(default_factory=dict)
    requested: frozenset[str] = frozenset()
    requested_first: frozenset[str] = frozenset()
    chains: dict[str, ChainEntry] = field(default_factory=dict)
    cameras: tuple[CameraEntry, ...] = ()
    sensors: tuple[SensorEntry, ...] = ()
    payload: Parcel | None = None
    own_tracker: PartUse | None = None
    known: dict[str, Any] = field(default_factory=dict, init=False, compare=False, repr=False)
    """What checks have worked out of it, for those that ask again."""

    def goal(self, name: str) -> str:
        """The state that `name` means as a goal: a chain's name means its first state."""
        if name in self.states:
            return name
        if "first states" not in self.known:
            firsts: dict[str, str] = {}
            for state in self.states:
                for chain in chains_of(state):
                    firsts.setdefault(chain, state)
            self.known["first states"] = firsts
        first: str = self.known["first states"].get(name, name)
        return first


@dataclass(frozen=True, slots=True)
class AirframeEntry:
    """An airframe that the mission itself describes, whether something flies it or not."""

    name: Text
    airframe: Airframe
    spans: dict[str, Span]


class Scan(NamedTuple):
    """What was scanned: the key that it is written with, its parameters as declared, its files, and
    where they are named."""

    kind: str
    params: Any
    files: tuple[File, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class ObstacleEntry:
    """One entry of `world.obstacles`. may_touch: it is there to be touched. scan: what
    something scanned is made of."""

    name: Text
    shape: Shape
    span: Span
    may_touch: bool = False
    scan: Scan | None = None


@dataclass(frozen=True, slots=True)
class MovingEntry:
    """One entry of `world.obstacles` that moves."""

    name: Text
    sphere: MovingSphere
    span: Span

    def tracked_by(
        self, vehicles: Iterable[VehicleEntry]
    ) -> tuple[VehicleEntry, PartUse, Any] | None:
        """The first sensor that can tell where it is, with its vehicle and the parameters for it;
        None where there is none."""
        body = self.sphere.body or self.name.text
        for vehicle in vehicles:
            for sensor in vehicle.sensors:
                if sensor.part.spec.cls.tracks_bodies:
                    params = sensor.part.spec.cls.tracking(sensor.part.params, body)
                    return vehicle, sensor.part, params
        return None


@dataclass(frozen=True, slots=True)
class TagsEntry:
    """One entry of `world.tags`: its parameters as declared, and the tags that they mean. `lines`
    are those of a file, where the tags stand in one."""

    name: Text
    params: Any
    tags: tuple[Tag, ...]
    span: Span
    lines: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class ActionEntry:
    """One action as written: `{NAME: VALUE}`, or one of `{NAME: {TARGET: VALUE}}`. `value` is a
    Text, the node of an option's value, None for an action from a package, which has a `part`.
    `values` are those with which a state is entered."""

    name: Text
    target: Text | None
    value: Any
    part: PartUse | None = None
    values: Mapping | None = None


@dataclass(frozen=True, slots=True)
class CallbackEntry:
    """One entry of `on:`. One without an event is done when its condition has held for `hold`
    seconds."""

    event: Text | None
    fields: tuple[tuple[Text, Text], ...]
    when: Text | None
    actions: tuple[ActionEntry, ...]
    span: Span
    hold: float = 0.0


@dataclass(frozen=True, slots=True)
class InputEntry:
    """One entry of `inputs:`, or what the target has in its place. renamed: the device's button
    behind each name that the mission gives."""

    name: Text
    part: PartUse
    silent_after: float
    stuck_after: float | None
    dead_man: Text | None
    renamed: tuple[tuple[Text, Text], ...]
    spans: dict[str, Span] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[str, ...]:
        axes: tuple[str, ...] = self.part.spec.cls.axes(self.part.params)
        return axes

    @property
    def buttons(self) -> dict[str, str]:
        """What the mission calls each of the device's buttons; one whose name it gives to another
        is not heard."""
        given = {device.text: name.text for name, device in self.renamed}
        taken = set(given.values())
        own = self.part.spec.cls.buttons(self.part.params)
        return {b: given.get(b, b) for b in own if b in given or b not in taken}


@dataclass(frozen=True, slots=True)
class FaultEntry:
    """One entry of `faults:`."""

    part: PartUse
    vehicle: Text
    time: float | None
    when: Text | None
    duration: float | None
    span: Span


@dataclass(frozen=True, slots=True)
class PhaseEntry:
    """One phase of a flow as written; keys of `run` and `give` are vehicles or groups. `values` are
    those with which a key of `run` enters its state. `inherited` is true when it came through
    `like`. `arrive` is one of `Arrive`, None where it isn't written."""

    name: Text
    run: tuple[tuple[Text, Text], ...]
    give: tuple[tuple[Text, Text], ...]
    set: tuple[ActionEntry, ...]
    transitions: tuple[TransitionEntry, ...]
    span: Span
    inherited: bool = False
    values: dict[str, Mapping] = field(default_factory=dict)
    arrive: Text | None = None


@dataclass(frozen=True, slots=True)
class FlowEntry:
    """One entry of `flows:`. The `transitions` of the flow are also among those of its phases."""

    name: Text
    begin: Text
    phases: dict[str, PhaseEntry]
    span: Span
    transitions: tuple[TransitionEntry, ...] = ()


@dataclass(frozen=True, slots=True)
class Parameter:
    """A mission parameter after `--set`: its value (SI; a vector for a position), its dimension's
    name."""

    name: str
    type: str
    value: Any


@dataclass(frozen=True, slots=True)
class Document:
    """A whole mission as written. `spans` holds the span of each key of the top level that was
    written, of the fence and of the world's tags."""

    mission: Text
    summary: str
    target: Text
    parameters: dict[str, Parameter]
    fence: Box | None
    control_rate: int
    control_span: Span | None
    hover_limit: float
    time_limit: float
    vehicles: dict[str, VehicleEntry]
    expect: tuple[Text, ...]
    airframes: tuple[AirframeEntry, ...] = ()
    spans: dict[str, Span] = field(default_factory=dict)
    points: dict[str, Vec3] = field(default_factory=dict)
    point_spans: dict[str, Span] = field(default_factory=dict)
    obstacles: tuple[ObstacleEntry, ...] = ()
    moving: tuple[MovingEntry, ...] = ()
    tags: tuple[TagsEntry, ...] = ()
    groups: dict[str, tuple[Text, ...]] = field(default_factory=dict)
    group_spans: dict[str, Span] = field(default_factory=dict)
    callbacks: tuple[CallbackEntry, ...] = ()
    faults: tuple[FaultEntry, ...] = ()
    flows: dict[str, FlowEntry] = field(default_factory=dict)
    inputs: dict[str, InputEntry] = field(default_factory=dict)
