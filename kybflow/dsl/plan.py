"""The records of a mission: its contents and meaning, frozen, in SI. The compiler decodes and
checks them, `bind` resolves their names, and the runtime sees nothing else of a mission.

A field with `key(...)` is a key of the language: its schema, text, docs and completion follow from
that one declaration. A field without `key(...)` is computed by the compiler. Records can be built
in a test without YAML. `at` is always the `file:line` from which a value came, for events and
reports; it is empty for values that the language adds.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple

from kybflow.core.files import File
from kybflow.core.geometry import Vec3
from kybflow.core.params import FLAT, NAMED, OR_NAME, Field, fields_of, key, record
from kybflow.core.units import Angle, Duration, Frequency, Length, Path, Position
from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.expressions import Expression
from kybflow.dsl.language.records import (
    CONDITION,
    EVENT,
    EVENT_FIELD,
    OPTION_VALUE,
    PHASE,
    REQUEST,
    SCALARS,
    SENSORS,
    STATE,
    TITLE,
    VERSION,
    AnyOf,
    Record,
    UsesOf,
    part_of,
    record_of,
)
from kybflow.dsl.reading.nodes import Node, Scalar, entries_of
from kybflow.dsl.reading.values import TYPES
from kybflow.dsl.world import CameraPlan, World
from kybflow.parts import Footprint, Leg
from kybflow.parts.observables import chains_of
from kybflow.world.cameras import Camera
from kybflow.world.objects import WorldObject
from kybflow.world.shapes import Box, MovingSphere, Shape
from kybflow.world.tags import TagMap
from kybflow.world.vehicle_context import NO_TAGS, Airframe, Parcel

Cause = Literal["next", "then", "failed", "within"]
END = "end"
"""The target of a phase's transition that ends the flow."""
MERGES = "mappings merge, lists are replaced, `null` removes."


@dataclass(frozen=True)
class PartPlan(Record):
    """A part to build. name: its name in the catalog. cls: its class. params: its decoded
    parameters. label: its name in options."""

    name: str
    cls: type[Any]
    params: Any
    label: str
    at: str = ""

    @property
    def alias(self) -> str:
        """The part's name among the parts of the same kind."""
        return self.label.partition(".")[2] or self.name

    @property
    def fields(self) -> tuple[Field, ...]:
        """The declarations of the part's parameters."""
        return fields_of(self.params.__class__)


@record("transition", is_whole=True, terse=True)
class TransitionPlan(Record):
    """A transition out of a behavior: all of `when`, `event` and `after` that are given must be
    met.

    cause: when the transition fires. `next` fires when everything written holds: `when` has held
    for `hold` seconds, `event` was emitted, and `after` seconds have passed in the state. `then`
    fires when the behavior is done, `failed` when it failed, and `within` after `after` seconds.
    implied: whether the language added the transition. since: the chain from whose entry `after`
    counts, or empty for the state; in a phase, the flow that declares this transition for all its
    phases. enters: the chain that the transition re-enters, or empty. emit: the event that is
    emitted when the transition is taken.
    """

    cause: Cause = field(default="next", kw_only=True)
    when: Annotated[Expression | None, CONDITION] = key(
        "A condition, like `state.altitude > 1 m`.", default=None
    )
    event: Annotated[str | None, EVENT] = key("The event to wait for.", default=None)
    after: Duration | None = key(
        "Time that the state must have lasted.", default=None, at_least=0.0
    )
    hold: Duration = key(
        "Time for which the condition must hold.", default=0.0, at_least=0.0, key="for"
    )
    emit: str | None = key(
        "An event of the mission's own, emitted when this transition is taken.", default=None
    )
    target: Annotated[str, STATE] = key(
        "The behavior or phase to go to; `end` leaves a chain or a flow.", key="go"
    )
    implied: bool = False
    at: str = ""
    since: str = ""
    enters: str = ""

    @property
    def target_span(self) -> Span:
        """The source location of the target's name, or of the transition if the name isn't written
        there."""
        text = self.text_of("go")
        return self.span if text is None else text.span


Ways = tuple[TransitionPlan, ...]
Goal = Annotated[str | None, STATE]
_THEN, _NEXT = (
    "State that follows when the behavior is done.",
    "Transitions, evaluated from the top in every tick.",
)
_FAILED, _WITHIN = (
    "State that follows when the behavior fails.",
    "Time after which the behavior fails.",
)


@record("behavior")
class StatePlan(Record):
    """One state: the vehicle's behavior, and the transitions that leave it.

    transitions: evaluated in order. estimators: they precede the vehicle's other estimators, in
    this order, while the state is active.
    """

    name: str
    behavior: Annotated[PartPlan, part_of("behaviors", "do", is_needed=False)] = key(
        "The behavior to fly; its parameters are keys beside it.", key="do"
    )
    legs: tuple[Leg, ...]
    transitions: Ways
    built_in: bool = False
    at: str = ""
    estimators: tuple[str, ...] = key(
        "Estimators of the vehicle that this behavior prefers, in this order.",
        default=(), least=1, each="Name of an estimator.", examples=(["mocap"],),
    )  # fmt: skip
    next: Ways = key(_NEXT, default=())
    then: Goal = key(_THEN, default=None)
    failed: Goal = key(_FAILED, default=None)
    within: Duration | None = key(_WITHIN, default=None, above=0.0)

    @functools.cached_property
    def footprints(self) -> dict[Vec3 | None, Footprint | None]:
        """A cache of the behavior's footprint by the position of entry."""
        return {}

    def footprint(self, entry: Vec3 | None) -> Footprint | None:
        """Return the space that the behavior needs when it is entered at `entry`. Cached, since
        several checks need it."""
        if entry not in self.footprints:
            self.footprints[entry] = self.behavior.cls.footprint(self.behavior.params, entry)
        return self.footprints[entry]


@record("chain's own entry")
class ChainPlan(Record):
    """A behavior that is a chain of the states `NAME.INNER`. Each of these states has the chain's
    transitions too."""

    name: str
    transitions: Ways = ()
    next: Ways = key(_NEXT, default=())
    then: Goal = key(_THEN, default=None)
    failed: Goal = key(_FAILED, default=None)
    within: Duration | None = key(_WITHIN, default=None, above=0.0)


@record("estimator", is_whole=True)
class EstimatorPlan(Record):
    """An estimator with its health.

    It is healthy while the condition holds; after it was unhealthy, it is used again only when the
    condition has held for `recover_after` seconds.
    """

    part: Annotated[PartPlan, part_of("estimators")] = key("Name of the part.", key="use")
    healthy: Annotated[Expression | None, CONDITION] = key(
        "The condition under which the estimate may be used, like `age < 100 ms`.", default=None
    )
    recover_after: Duration = key(
        "Time for which the estimator must be healthy before it is used again.",
        default=0.0,
        at_least=0.0,
    )
    for_at_most: Duration | None = key(
        "Longest time for which the estimator is used without a break.", default=None, above=0.0
    )


Estimators = Annotated[tuple[EstimatorPlan, ...], UsesOf("list", item=record_of(EstimatorPlan))]
Processors = Annotated[tuple[PartPlan, ...], UsesOf("list", item=part_of("processors"))]
Supervisors = Annotated[tuple[PartPlan, ...], UsesOf("list", item=part_of("supervisors"))]
"""The lists of a vehicle that may contain stacks."""
LISTS = ("estimators", "processors", "supervisors")


@dataclass(frozen=True)
class SensorPlan(Record):
    """A sensor beside the driver. estimators: the estimators that use it; empty if the driver adds
    the sensor itself. index: its position in the list of the first estimator's sensors."""

    part: PartPlan
    estimators: tuple[str, ...] = ()
    index: int = 0

    @property
    def label(self) -> str:
        """The sensor's name in options: `fusion` for an estimator's first sensor, then
        `fusion.1`."""
        name = self.estimators[0] if self.estimators else self.part.alias
        return f"{name}.{self.index}" if self.index else name


@record("start")
class Start(Record):
    """Where the vehicle stands before take-off."""

    at: Position = key("Position, world frame (ENU).", default=(0.0, 0.0, 0.0))
    heading: Angle = key("Angle of the nose from east, counter-clockwise.", default=0.0)


@record("line of starts")
class LineOfStarts(Record):
    """Starts on a line, evenly spaced."""

    begin: Position = key("Position of the first.", key="from")
    end: Position = key("Position of the last.", key="to")


@record("grid of starts")
class GridOfStarts(Record):
    """Starts in rows from south to north, each from west to east."""

    at: Position = key("Position of the first, in the south-west.")
    columns: int = key("Number of vehicles in a row.", at_least=1)
    spacing: Length = key("Distance between neighbours.", above=0.0)


@record("circle of starts")
class CircleOfStarts(Record):
    """Starts on a circle, evenly spaced, counter-clockwise from the east."""

    at: Position = key("Centre of the circle.")
    radius: Length = key("Its radius.", above=0.0)


@record("layout of starts")
class Starts(Record):
    """Where several vehicles stand before take-off."""

    line: LineOfStarts | None = key("Evenly spaced on a line.", default=None)
    grid: GridOfStarts | None = key(
        "In rows from south to north, each from west to east.", default=None
    )
    circle: CircleOfStarts | None = key(
        "Evenly spaced on a circle, counter-clockwise from the east.", default=None
    )
    points: Path | None = key("Their positions, one by one.", default=None)


MOST_COPIES = 100


@record("airframe", like="Start from this airframe.", block=True)
class Body(Record):
    """An airframe with the cameras that it carries."""

    airframe: Annotated[Airframe, FLAT] = key("", default=None)
    cameras: Annotated[tuple[CameraPlan, ...], NAMED] = key(
        "Cameras of the airframe, by name.", default=()
    )
    name: str = ""


@record("vehicle's target")
class Place(Record):
    """How a vehicle is reached."""

    driver: Annotated[PartPlan | None, part_of("drivers")] = key(
        "The driver; by default the one that the target's name implies.", default=None
    )
    tracker: Annotated[PartPlan | None, part_of("trackers")] = key(
        "The tracker on this target; by default the one that the driver names, or else the "
        "vehicle's own.",
        default=None,
    )
    sensors: dict[str, Annotated[tuple[PartPlan, ...], SENSORS]] = key(
        "Sensors beside the driver, under the names of estimators.", default={},
        each="The sensors that provide the estimator's measurements: one, or a list.",
    )  # fmt: skip


@record("vehicle", like=f"Start from this vehicle: {MERGES}", block=True)
class VehiclePlan(Record):
    """A vehicle: its airframe, its chain from sensors to commands, its states.

    begin: the first state: the one written, or else the first behavior. states: the states of
    `behaviors`, and the built-in ones once names are resolved. requested: the states that callbacks
    and flows may request at any time. requested_first: those that flows request while the vehicle
    waits on the ground at its start. own_tracker: the mission's tracker, if the target replaces it.
    """

    name: str
    count: int | None = key(
        "Number of vehicles like this one: NAME1, NAME2, ... and the group NAME.",
        default=None, at_least=1, at_most=MOST_COPIES,
    )  # fmt: skip
    starts: Starts | None = key(
        "Where the vehicles of `count` stand before take-off.", default=None,
        examples=({"line": {"from": [-1, 0, 0], "to": [1, 0, 0]}},),
    )  # fmt: skip
    body: Annotated[Body, OR_NAME] = key(
        "Name of an airframe, or its numbers.", key="airframe", default=Body()
    )
    place: Start = key(
        "Where the vehicle stands before take-off.", key="start", default=Start(),
        examples=({"at": [0, 0, 0]},),
    )  # fmt: skip
    home: Position | None = key(
        "Position to which `go_home` flies; by default the start.", default=None
    )
    payload: Parcel | None = key(
        "The payload that the vehicle carries and can release.", default=None,
        examples=({"mass": "200 g", "size": "10 cm", "channel": 1, "aboard": True},),
    )  # fmt: skip
    estimators: Estimators = key(
        "The estimators, of which the first healthy one is used.", default=()
    )
    processors: Processors = key(
        "The processors, which may change the setpoint, in this order.", default=()
    )
    tracker: Annotated[PartPlan, part_of("trackers", is_needed=False)] = key(
        "The tracker, which turns setpoints into commands.", needed=False
    )
    supervisors: Supervisors = key(
        "Supervisors in addition to those that every vehicle has; each watches a bound.", default=()
    )
    begin: Annotated[str, STATE] = key(
        "The first behavior; by default the topmost, or `landed` for a vehicle that a flow "
        "controls.",
        needed=False,
    )
    behaviors: dict[str, StatePlan] = key(
        "The vehicle's state machine: exactly one is active.", default={}, names_like="dotted"
    )
    airframe: Airframe
    start: Vec3
    heading: float
    driver: PartPlan
    states: dict[str, StatePlan]
    at: str = ""
    hover_limit: float = 30.0
    """Seconds after which a paused or braked vehicle lands."""
    cameras: dict[str, Camera] = field(default_factory=dict)
    sensors: tuple[SensorPlan, ...] = ()
    chains: dict[str, ChainPlan] = field(default_factory=dict)
    own_tracker: PartPlan | None = None
    reached: Place = Place()
    """How the vehicle is reached on the target: each key from the vehicle's own entry, or else from
    `all`."""
    requested: frozenset[str] = frozenset()
    requested_first: frozenset[str] = frozenset()

    @functools.cached_property
    def known(self) -> dict[str, Any]:
        """A cache of the checks' results about the vehicle."""
        return {}

    @property
    def parts(self) -> list[PartPlan]:
        """Every part of the vehicle except its driver and its sensors."""
        return [
            *(estimator.part for estimator in self.estimators),
            *self.processors,
            self.tracker,
            *self.supervisors,
            *(state.behavior for state in self.states.values()),
        ]

    def with_part(self, part: PartPlan) -> VehiclePlan:
        """Return the vehicle with this part in place of the one that has its label."""

        def chosen(own: PartPlan) -> PartPlan:
            return part if own.label == part.label else own

        return self.but(
            estimators=tuple(use.but(part=chosen(use.part)) for use in self.estimators),
            processors=tuple(map(chosen, self.processors)),
            tracker=chosen(self.tracker),
            supervisors=tuple(map(chosen, self.supervisors)),
            states={
                name: state.but(behavior=chosen(state.behavior))
                for name, state in self.states.items()
            },
        )

    @property
    def own_cameras(self) -> dict[str, Camera]:
        """The cameras of the airframe, by name."""
        return {use.name: use.camera for use in self.body.cameras if use.camera is not None}

    def goal(self, name: str) -> str:
        """Return the state that `name` means as a goal: the state itself, or the first state of a
        chain."""
        return name if name in self.states else self._firsts.get(name, name)

    @functools.cached_property
    def _firsts(self) -> dict[str, str]:
        """The first state of each chain, by the chain's name."""
        return {chain: state for state in reversed(self.states) for chain in chains_of(state)}


Values = tuple[tuple[str, Any], ...]
"""Values (SI) by parameter name that replace those of a state."""


@dataclass(frozen=True)
class Request(Record):
    """The request that a vehicle enter a state. values: parameter values (SI) that replace those of
    the state. chain: the requested chain, if the state is its first one."""

    state: str
    values: Values = ()
    chain: str = ""


@dataclass(frozen=True, slots=True)
class Switch:
    """Request that a vehicle enter a state. values: values that replace those of its parameters; in
    an operator's command they are text."""

    vehicle: str
    state: str
    values: Values = ()


@dataclass(frozen=True, slots=True)
class SetOption:
    """Change the value (SI) of an option."""

    option: str
    value: Any


@dataclass(frozen=True, slots=True)
class Enable:
    """Switch a processor on or off; safety parts can't be switched."""

    vehicle: str
    label: str
    on: bool


@dataclass(frozen=True, slots=True)
class Emit:
    """Emit a custom event."""

    name: str


@dataclass(frozen=True, slots=True)
class EnterPhase:
    """Request that a flow enter a phase."""

    flow: str
    phase: str


@dataclass(frozen=True, slots=True)
class Perform:
    """Request that a vehicle perform one of its driver's actions."""

    vehicle: str
    act: str


@dataclass(frozen=True, slots=True)
class LogText:
    """Log a text, in which `{vehicle}`, `{time}` and the event's fields are filled in."""

    text: str


@dataclass(frozen=True, slots=True)
class Stop:
    """Land every vehicle and end the run."""

    reason: str


@dataclass(frozen=True, slots=True)
class Call:
    """Call an action from a package."""

    part: PartPlan


ActionPlan = Switch | SetOption | Enable | Emit | EnterPhase | Perform | LogText | Stop | Call


@record("action", least=1, others=AnyOf("value", kinds=("object", *SCALARS, "array")))
class ActionKeys(Record):
    """One action of a callback, such as `{set: {a.speed: 1 m/s}}`.

    name: the action's key, here `set`. target, value: what the key holds; with `switch`, `set` and
    `perform`, each target is an action of its own. part: the part that implements the action, if an
    installed package declares it.
    """

    name: str
    target: str | None = None
    value: Any = None
    part: PartPlan | None = None
    switch: dict[str, Annotated[Request, REQUEST]] = key(
        "Vehicles or groups, and the state that each is to enter.",
        default={}, least=1, names_like="any", each="The state", examples=({"a": "home"},),
    )  # fmt: skip
    set: dict[str, Annotated[Any, OPTION_VALUE]] = key(
        "Options, like `a.processors.limit_speed.speed`, and their new values.",
        default={}, least=1, names_like="any",
    )  # fmt: skip
    enable: str | None = key(
        "A processor to switch on again, like `a.processors.limit_speed`.", default=None
    )
    disable: str | None = key(
        "A processor to switch off; safety processors are always on.", default=None
    )
    emit: str | None = key("An event of the mission's own, raised in the next tick.", default=None)
    phase: Annotated[Any, PHASE] = key(
        "A phase to enter; `{FLOW: PHASE}` where several flows have it.",
        default=None, least=1, each="The phase.",
    )  # fmt: skip
    perform: dict[str, str] = key(
        "Vehicles or groups, and the act that the driver of each is to perform, like "
        "`leds_blink_red`.",
        default={}, least=1, names_like="any", each="The act.", examples=({"a": "leds_blink_red"},),
    )  # fmt: skip
    log: str | None = key(
        "A text for the recording, in which `{event}`, `{time}`, `{vehicle}` and the event's "
        "fields are replaced.",
        default=None,
    )
    stop: str | None = key("The reason why the run ends: every vehicle lands.", default=None)

    @property
    def value_text(self) -> Text:
        """The value with its source location; for `phase` and `set`, the value of the target."""
        node = self.value_node
        return node.as_text if isinstance(node, Scalar) else Text("", self.span, verbatim=False)

    @property
    def value_node(self) -> Node:
        """The value as written."""
        (entry,) = entries_of(self.source.node).values()
        return entry.value

    @property
    def target_text(self) -> Text:
        """The target with its source location."""
        (entry,) = entries_of(self.source.node).values()
        return entry.key.as_text


@record("callback", is_whole=True, others=EVENT_FIELD, terse=True)
class CallbackPlan(Record):
    """An event or a condition, and the actions that it brings about.

    The actions are done in order when one of `vehicles` (an empty string stands for the run) emits
    the event `event`, its fields have the values in `fields`, and `when` holds. Without an event,
    they are done each time that `when` has held for `hold` seconds.
    """

    event: Annotated[str, EVENT] = key(
        "The event: `VEHICLE.NAME`, `GROUP.NAME`, `any.NAME` of every vehicle, `operator.NAME` "
        "of a person, or the bare name of an event of the run or of the mission itself.",
        needed=False,
    )
    vehicles: tuple[str, ...]
    actions: tuple[ActionPlan, ...]
    fields: tuple[tuple[str, str], ...] = ()
    when: Annotated[Expression | None, CONDITION] = key(
        "A condition that must also hold, like `a in landed`, with the names of vehicles. "
        "Without `event`, the actions run when the condition begins to hold, and again only "
        "after it has been false.",
        default=None,
    )
    hold: Duration = key(
        "How long a condition without an `event` must hold.",
        default=0.0, at_least=0.0, key="for",
    )  # fmt: skip
    do: tuple[ActionKeys, ...] = key(
        "The actions, each a mapping with one key.", default=(), needed=True,
        examples=([{"log": "hello"}, {"stop": "enough"}],),
        each_examples=([{"log": "hello"}, {"stop": "enough"}],),
    )  # fmt: skip
    at: str = ""


@record("input", is_whole=True)
class InputPlan(Record):
    """A device, or a script of one.

    button_names: the mission's name for each of the device's buttons. dead_man: the mission's name
    of the button that must be held to steer, or None. silent_after: the input is lost if it sends
    nothing for longer, seconds. stuck_after: the input is lost if an axis off its centre doesn't
    change for longer, seconds; None for never.
    """

    name: str
    part: Annotated[PartPlan, part_of("inputs")] = key("Name of the part.", key="use")
    button_names: dict[str, str]
    silent_after: Duration = key("Silence after which the input is lost.", default=0.3, above=0.0)
    stuck_after: Duration | None = key(
        "Time without a change of an axis away from its centre after which the input is lost; by "
        "default that of the device, 10 s for gamepads and transmitters.",
        default=None, at_least=1.0,
    )  # fmt: skip
    dead_man: str | None = key(
        "The dead-man button: the vehicle brakes when it is released.", default=None
    )
    buttons: dict[str, str] = key(
        "The mission's names for buttons of the device, like `{leave: a}`.",
        default={}, each="The device's name of the button.",
    )  # fmt: skip
    at: str = ""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the device."""
        axes: tuple[str, ...] = self.part.cls.axes(self.part.params)
        return axes


@record("fault", is_whole=True)
class FaultPlan(Record):
    """A fault of one vehicle, which begins `at` a time or `when` a condition first holds.

    part: the fault. It begins at `time` seconds of the run, or when `when` first holds, and lasts
    for `duration` seconds, or until the end of the run if that is None.
    """

    when: Annotated[Expression | None, CONDITION] = key(
        "The fault begins when this condition of the vehicle first holds, like `behavior == hop`.",
        default=None,
    )
    time: Duration | None = key(
        "The fault begins at this time of the run.", default=None, at_least=0.0, key="at"
    )
    vehicle: str = key("The vehicle that the fault affects.", key="on")
    part: Annotated[PartPlan, part_of("faults", "inject")] = key(
        "The fault; its parameters are keys beside it.", key="inject"
    )
    duration: Duration | None = key(
        "Duration of the fault; by default to the end of the run.",
        default=None,
        above=0.0,
        key="for",
    )
    at: str = ""


Arrive = Literal["together", "in_turns"]
"""How the vehicles of a phase arrive: at the same time, or one after the other."""


@record("phase")
class PhasePlan(Record):
    """A step of a flow: the requests that begin together, and the transitions. A phase without
    transitions is the last one.

    On entry a phase gives vehicles to other flows, sets options and requests states of vehicles.
    transitions: evaluated as in a state: `next` from the top, then `within`; the target `end` ends
    the flow. ends: whether the flow also ends when no vehicle that the phase ran is in its
    requested state any more, as it does in a phase without transitions. run, give: by vehicle once
    names are resolved. arrive: how the vehicles of `run` arrive; each on its own if it is None.
    """

    name: str
    give: dict[str, str] = key(
        "Vehicles or groups, and the flow that controls each from here on.",
        default={}, each="The flow, which gives the vehicle back when it ends.",
    )  # fmt: skip
    set: dict[str, Annotated[Any, OPTION_VALUE]] = key(
        "Options, like `swarm.processors.limit_speed.speed`, and their new values.",
        default={}, least=1, names_like="any",
    )  # fmt: skip
    run: dict[str, Annotated[Request, REQUEST]] = key(
        "Vehicles or groups, and the behavior that each is to enter.",
        default={}, each="The behavior",
    )  # fmt: skip
    arrive: Arrive | None = key(
        "How the vehicles of `run` arrive: `together`, on straight lines with a common duration, "
        "or `in_turns`, each after the previous one has arrived.",
        default=None,
    )
    coordinator: Annotated[PartPlan | None, part_of("coordinators")] = key(
        "What gives the vehicles of `run` a value each in every tick, like the force that each of "
        "them shares.",
        default=None,
    )
    next: Ways = key(
        "Transitions, evaluated from the top in every tick; `end` ends the flow.", default=()
    )
    within: Duration | None = key(
        "Largest duration of the phase, after which `otherwise` follows.", default=None, above=0.0
    )
    otherwise: Goal = key("The phase that follows when `within` expires, or `end`.", default=None)
    transitions: Ways = ()
    options: tuple[SetOption, ...] = ()
    ends: bool = False
    at: str = ""


@record("flow", is_whole=True, like=f"Start from this flow: {MERGES}", block=True)
class FlowPlan(Record):
    """Phases over several vehicles; only one flow at a time controls a vehicle.

    vehicles: the vehicles that the flow drives from the start. waits: whether the flow begins only
    when it is given a vehicle. The flow's `next` transitions are also included in those of its
    phases.
    """

    name: str
    begin: Annotated[str, STATE] = key("The first phase; by default the topmost.", needed=False)
    next: Ways = key("Transitions of every phase except their target, evaluated first.", default=())
    vehicles: tuple[str, ...]
    phases: dict[str, PhasePlan] = key("The phases, of which exactly one is active.", least=1)
    waits: bool = False
    at: str = ""


@record("target", others=record_of(Place))
class TargetKeys(Record):
    """How each vehicle is reached: `all`, or by a vehicle's name."""

    inputs: Annotated[tuple[InputPlan, ...], NAMED] = key(
        "Devices for steering, whose buttons raise events, by name.", default=()
    )


@dataclass(frozen=True)
class ExpectationPlan(Record):
    """One line of `expect:`. text: the line as written. expression: the parsed line."""

    text: str
    expression: Expression
    at: str


@dataclass(frozen=True, slots=True)
class SourceFile:
    """One file of the mission. path: its path as reported. sha256: the SHA-256 of its bytes."""

    path: str
    sha256: str


class Parameter(NamedTuple):
    """A mission parameter after `--set`. type: the name of its dimension or type. value: its value
    (SI; a vector for a position, vectors for a path)."""

    name: str
    type: str
    value: Any


PARAMETER_VALUE = AnyOf("value", kinds=("number", "string", "boolean", "array"))
BOUND = AnyOf("value", kinds=("number", "string"))


@record("parameter", is_whole=True)
class ParameterKeys(Record):
    """A value that `--set` may change; `$name` stands for it."""

    type: str = key(
        "Its type: a quantity such as `length`, or `position`, `path`, `integer`, `text` or "
        "`boolean`.",
        examples=tuple(TYPES),
    )
    default: Annotated[Any, PARAMETER_VALUE] = key(
        "The value if nothing else sets one.", default=None
    )
    above: Annotated[Any, BOUND] = key("The value must be greater.", default=None)
    at_least: Annotated[Any, BOUND] = key("The value must be this or greater.", default=None)
    below: Annotated[Any, BOUND] = key("The value must be less.", default=None)
    at_most: Annotated[Any, BOUND] = key("The value must be this or less.", default=None)
    help: str | None = key("Description of the parameter.", default=None)


_EXAMPLE = ({"type": "length", "default": "1 m"},)


@record("import", is_whole=True)
class ImportKeys(Record):
    """A library, by its file."""

    file: str = key(
        "The library: one of an installed package, such as `kybflow/stacks`, or a file near this "
        "one, such as `library/lab.yaml`.",
        key="from",
    )
    values: Annotated[Any, AnyOf("value", kinds=("object",))] = key(
        "Values of its parameters, by name.", default=None, key="with"
    )


@record("chain", is_whole=True)
class ChainKeys(Record):
    """Behaviors that are used like one: `do: chain.NAME`, with its parameters beside it."""

    summary: str | None = key("Summary in one line.", default=None)
    parameters: dict[str, ParameterKeys] = key(
        "Parameters that each use of the chain sets.", default={}, each_examples=_EXAMPLE
    )
    begin: Goal = key("The first behavior; by default the topmost.", default=None)
    behaviors: dict[str, StatePlan] = key(
        "The states of the chain; `then: end`, or no `then`, leaves it."
    )


@record("stack", like="Start from this stack.")
class StackKeys(Record):
    """Parts for the lists of a vehicle: `- stack: NAME` stands for them."""

    summary: str | None = key("Summary in one line.", default=None)
    estimators: Estimators = key(
        "The estimators, of which the first healthy one is used.", default=()
    )
    processors: Processors = key(
        "The processors, which may change the setpoint, in this order.", default=()
    )
    supervisors: Supervisors = key("Supervisors, each of which watches a bound.", default=())


@record()
class Shared(Record):
    """The keys that both missions and libraries may have."""

    summary: str = key("Summary in one line.", default="")
    imports: dict[str, Annotated[ImportKeys, OR_NAME]] = key(
        "Imported libraries, by name.", default={}, key="import"
    )
    parameters: dict[str, ParameterKeys] = key(
        "Parameters, which `--set` can change.", default={}, each_examples=_EXAMPLE
    )
    airframes: Annotated[tuple[Body, ...], NAMED] = key("Airframes by name.", default=())
    chains: dict[str, ChainKeys] = key(
        "Sequences that can be used as one behavior, by name.", default={}
    )
    stacks: dict[str, StackKeys] = key("Parts for the lists of a vehicle, by name.", default={})


Flows = Annotated[tuple[FlowPlan, ...], NAMED]
_FLOWS = "Flows, each of which coordinates several vehicles; they run in parallel."


@record("library", is_whole=True, leading=("library",))
class Library(Shared):
    """A library: definitions that several missions share."""

    library: Annotated[str, TITLE] = key("Its name.")
    vehicles: Annotated[tuple[VehiclePlan, ...], NAMED] = key("The vehicles, by name.", default=())
    worlds: dict[str, World] = key("Worlds by name.", default={})
    flows: Flows = key(_FLOWS, default=())


@record("mission", is_whole=True, leading=("kybflow", "mission"), block=True)
class Plan(Shared):
    """A kybflow mission: its vehicles with their estimators and behaviors, and the expectations."""

    version: Annotated[int, VERSION] = key(
        "Version of the language.", default=1, needed=True, key="kybflow"
    )
    mission: Annotated[str, TITLE] = key("Its name.")
    control: Frequency | None = key(
        "Control rate, a whole number of Hz; by default 125 Hz, or 100 Hz if every vehicle flies "
        "on an autopilot that takes at most 50 set-points per second.",
        default=None, above=0.0,
    )  # fmt: skip
    hover_limit: Duration = key(
        "Time after which the built-in hover lands.",
        default=30.0, above=0.0,
    )  # fmt: skip
    time_limit: Duration = key(
        "Time after which every vehicle lands and the run ends.", default=600.0, above=0.0
    )
    world: Annotated[World, OR_NAME] = key(
        "The name of a library's world, or a fence, points, obstacles and tags.",
        default=World(),
    )
    vehicles: Annotated[tuple[VehiclePlan, ...], NAMED] = key(
        "The vehicles, by name.", default=(), least=1, needed=True
    )
    inputs: Annotated[tuple[InputPlan, ...], NAMED] = key(
        "Devices for steering, whose buttons raise events, by name.", default=()
    )
    groups: dict[str, tuple[str, ...]] = key(
        "Groups of vehicles, as in `all swarm in hover`.",
        default={}, each="Its vehicles.", each_examples=(["a", "b"],),
    )  # fmt: skip
    flows: Flows = key(_FLOWS, default=())
    callbacks: tuple[CallbackPlan, ...] = key(
        "Callbacks: actions on events or conditions, at any time.", default=(), key="on"
    )
    faults: tuple[FaultPlan, ...] = key(
        "Injected faults, in simulation; with a firmware's own simulator, only those of "
        "kybflow's side.",
        default=(),
    )
    expect: tuple[str, ...] = key(
        "Expectations that must hold for the mission to succeed.", default=()
    )
    targets: dict[str, TargetKeys] = key(
        "Targets on which the mission can fly, chosen by `--target NAME`; `sim` and those of the "
        "drivers always exist.",
        default={},
    )
    target: str
    simulated: bool
    control_rate: int
    fence: Box | None
    expectations: tuple[ExpectationPlan, ...]
    sources: tuple[SourceFile, ...]
    resolved: str
    """The mission after imports, `like`, parameters and defaults, as YAML text."""
    obstacles: dict[str, Shape] = field(default_factory=dict)
    moving: dict[str, MovingSphere] = field(default_factory=dict)
    objects: dict[str, WorldObject] = field(default_factory=dict)
    touchable: frozenset[str] = frozenset()
    """The obstacles that vehicles may touch."""
    watching: dict[str, tuple[str, PartPlan]] = field(default_factory=dict)
    """The vehicle's name and the sensor that tracks each moving obstacle and each object, by name.
    One without an entry is simulated."""
    points: dict[str, Vec3] = field(default_factory=dict)
    tags: TagMap = NO_TAGS
    files: tuple[File, ...] = ()
    """The files that parameters name, as they are written in `resolved`."""
    part_files: tuple[SourceFile, ...] = ()
    """The files of parts with which it was compiled."""
    values: dict[str, Parameter] = field(default_factory=dict)
    """The values of the mission's parameters."""
    target_text: Text | None = field(default=None, compare=False, repr=False)
    """The target's name with its source location."""

    @functools.cached_property
    def fleet(self) -> dict[str, VehiclePlan]:
        """The vehicles by name."""
        return {vehicle.name: vehicle for vehicle in self.vehicles}

    def with_vehicles(self, changed: dict[str, VehiclePlan]) -> Plan:
        """Return the plan with these vehicles in place of those that have their names."""
        return self.but(vehicles=tuple(changed.get(own.name, own) for own in self.vehicles))

    def members(self, name: str) -> tuple[str, ...]:
        """Return the vehicles that a name stands for: the vehicle of this name, or those of the
        group; empty for an unknown name."""
        if name in self.fleet:
            return (name,)
        return tuple(member for member in self.groups.get(name, ()) if member in self.fleet)

    @functools.cached_property
    def kept_clear(self) -> tuple[str, ...]:
        """The obstacles that vehicles keep away from."""
        return tuple(n for n in (*self.obstacles, *self.moving) if n not in self.touchable)

    @functools.cached_property
    def tracked(self) -> dict[str, MovingSphere | WorldObject]:
        """The moving obstacles and the objects that move by themselves, by name."""
        return {**self.moving, **{name: one for name, one in self.objects.items() if one.moves}}

    def tracked_by(self, name: str) -> tuple[VehiclePlan, PartPlan, Any] | None:
        """Return the first sensor that can track a moving obstacle or an object: its vehicle, the
        part, and the part's parameters for tracking. None if there is no such sensor."""
        body = self.tracked[name].body or name
        for vehicle in self.vehicles:
            for part in (sensor.part for sensor in vehicle.sensors):
                if part.cls.tracks_bodies:
                    return vehicle, part, part.cls.tracking(part.params, body)
        return None

    @functools.cached_property
    def flows_by_name(self) -> dict[str, FlowPlan]:
        """The flows by name."""
        return {flow.name: flow for flow in self.flows}

    @functools.cached_property
    def giving(self) -> tuple[tuple[FlowPlan, PhasePlan], ...]:
        """The phases that give vehicles to other flows, each with its flow."""
        every = ((flow, phase) for flow in self.flows for phase in flow.phases.values())
        return tuple(one for one in every if one[1].give or one[1].is_written("give"))

    @functools.cached_property
    def inputs_by_name(self) -> dict[str, InputPlan]:
        """The inputs by name."""
        return {use.name: use for use in self.inputs}
