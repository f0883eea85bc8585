"""The mission as written, typed, with a span on everything: what `shape` makes, `check` judges and
`lower` turns into a plan. Names are still names; quantities are SI; `like`, imports and parameters
are gone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from kybflow.dsl.plan import Cause
from kybflow.dsl.source import Span, Text
from kybflow.geometry import Vec3
from kybflow.shapes import Box, Shape
from kybflow.site import Airframe

if TYPE_CHECKING:
    from kybflow.catalog import PartSpec


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


@dataclass(frozen=True, slots=True)
class Transition:
    """One arrow as written; `span` is the whole of it, `target.span` the name of its goal."""

    cause: Cause
    target: Text
    span: Span
    when: Text | None = None
    event: Text | None = None
    after: float | None = None
    hold: float = 0.0


@dataclass(frozen=True, slots=True)
class State:
    """One entry of `behaviors:`. `inherited` is true when it came through `like`."""

    name: Text
    part: PartUse
    transitions: tuple[Transition, ...]
    span: Span
    inherited: bool = False


@dataclass(frozen=True, slots=True)
class EstimatorUse:
    part: PartUse
    healthy: Text | None
    recover_after: float
    for_at_most: float | None


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle. `begin` is the name of the first state: the one written, else the first
    behavior. `airframe_spans` holds the span of each of the airframe's parameters that was
    written."""

    name: Text
    airframe: Airframe
    start: Vec3
    start_span: Span
    heading: float
    estimators: tuple[EstimatorUse, ...]
    processors: tuple[PartUse, ...]
    tracker: PartUse
    supervisors: tuple[PartUse, ...]
    driver: PartUse
    begin: Text
    states: dict[str, State]
    span: Span
    airframe_spans: dict[str, Span] = field(default_factory=dict)
    home: Vec3 | None = None
    home_span: Span | None = None


@dataclass(frozen=True, slots=True)
class AirframeUse:
    """An airframe that the mission itself describes, whether something flies it or not."""

    name: Text
    airframe: Airframe
    spans: dict[str, Span]


@dataclass(frozen=True, slots=True)
class ObstacleUse:
    """One entry of `world.obstacles`."""

    name: Text
    shape: Shape
    span: Span


@dataclass(frozen=True, slots=True)
class ActionUse:
    """One action as written, `{NAME: VALUE}`; `target` is the vehicle, option, event, flow or label
    that it is about, `value` what is asked of it: a state's, phase's or text's name, a node of an
    option's value. `part` is set for an action from a package."""

    name: Text
    target: Text | None
    value: Any
    part: PartUse | None = None


@dataclass(frozen=True, slots=True)
class Callback:
    """One entry of `on:`."""

    event: Text
    fields: tuple[tuple[Text, Text], ...]
    when: Text | None
    actions: tuple[ActionUse, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class FaultUse:
    """One entry of `faults:`."""

    part: PartUse
    vehicle: Text
    time: float | None
    when: Text | None
    duration: float | None
    span: Span


@dataclass(frozen=True, slots=True)
class Phase:
    """One phase of a flow as written; keys of `run` and `give` are vehicles or groups."""

    name: Text
    run: tuple[tuple[Text, Text], ...]
    give: tuple[tuple[Text, Text], ...]
    set: tuple[ActionUse, ...]
    transitions: tuple[Transition, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class Flow:
    """One entry of `flows:`."""

    name: Text
    begin: Text
    phases: dict[str, Phase]
    span: Span


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
    written."""

    mission: Text
    summary: str
    target: Text
    parameters: dict[str, Parameter]
    fence: Box | None
    control_rate: int
    control_span: Span | None
    hover_limit: float
    time_limit: float
    vehicles: dict[str, Vehicle]
    expect: tuple[Text, ...]
    airframes: tuple[AirframeUse, ...] = ()
    spans: dict[str, Span] = field(default_factory=dict)
    points: dict[str, Vec3] = field(default_factory=dict)
    point_spans: dict[str, Span] = field(default_factory=dict)
    obstacles: tuple[ObstacleUse, ...] = ()
    groups: dict[str, tuple[Text, ...]] = field(default_factory=dict)
    callbacks: tuple[Callback, ...] = ()
    faults: tuple[FaultUse, ...] = ()
    flows: dict[str, Flow] = field(default_factory=dict)
