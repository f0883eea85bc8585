"""The plan: what a mission means, frozen, in SI, with no YAML left. The only thing that the runtime
sees.

It can be built in a test without YAML. `at` is always `file:line` of the text that a value came
from, for events and reports; it is empty for what nobody wrote.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from kybflow.core.files import File
from kybflow.core.geometry import Vec3
from kybflow.dsl.expressions import Expression
from kybflow.parts import Leg
from kybflow.world.cameras import Camera
from kybflow.world.moving_sphere import MovingSphere
from kybflow.world.shapes import Box, Shape
from kybflow.world.tags import TagMap
from kybflow.world.vehicle_context import NO_TAGS, Airframe, Parcel

Cause = Literal["next", "then", "failed", "within"]
END = "end"
"""Where a transition of a phase leads to end its flow."""


@dataclass(frozen=True, slots=True)
class PartPlan:
    """A part to build: its name in the catalog, its class, its decoded parameters. `label` is its
    name in options."""

    name: str
    cls: type[Any]
    params: Any
    label: str
    at: str = ""


@dataclass(frozen=True, slots=True)
class TransitionPlan:
    """One transition out of a state.

    `next` fires when `when` has held for `hold` seconds, or `event` is heard, or `after` seconds
    have passed in the state (those that are given, together); `then` when the behavior is done;
    `failed` when it failed; `within` after `after` seconds. `implied` transitions are those that
    the language adds. Seconds count from the entry of the chain `since` where it is not empty;
    `enters` is the chain that the transition enters anew. `emit` is the event of the mission's own
    that it emits when it is taken.
    """

    cause: Cause
    target: str
    when: Expression | None = None
    event: str | None = None
    after: float | None = None
    hold: float = 0.0
    implied: bool = False
    at: str = ""
    since: str = ""
    enters: str = ""
    emit: str | None = None


@dataclass(frozen=True, slots=True)
class StatePlan:
    """One state of a vehicle: a behavior and its transitions, in the order in which they are asked.
    `estimators` come before the vehicle's others, in this order, while it is active."""

    name: str
    behavior: PartPlan
    legs: tuple[Leg, ...]
    transitions: tuple[TransitionPlan, ...]
    built_in: bool = False
    at: str = ""
    estimators: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class EstimatorPlan:
    """An estimator with its health: healthy while the condition holds, and again only after
    `recover_after` seconds."""

    part: PartPlan
    healthy: Expression | None
    recover_after: float
    for_at_most: float | None


@dataclass(frozen=True, slots=True)
class SensorPlan:
    """A sensor beside the driver: the estimators that it was named for, none where the driver
    brings it."""

    part: PartPlan
    estimators: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class VehiclePlan:
    """One vehicle. `begin` is the state it starts in; `states` include the built-in ones."""

    name: str
    airframe: Airframe
    start: Vec3
    heading: float
    estimators: tuple[EstimatorPlan, ...]
    processors: tuple[PartPlan, ...]
    tracker: PartPlan
    supervisors: tuple[PartPlan, ...]
    driver: PartPlan
    begin: str
    states: dict[str, StatePlan]
    at: str = ""
    home: Vec3 | None = None
    """Where `go_home` flies; None for the start."""
    hover_limit: float = 30.0
    """Seconds after which a vehicle that was paused or braked lands."""
    cameras: dict[str, Camera] = field(default_factory=dict)
    sensors: tuple[SensorPlan, ...] = ()
    payload: Parcel | None = None


Values = tuple[tuple[str, Any], ...]
"""Parameters by name, each with a value (SI) in place of the one that a state has."""


@dataclass(frozen=True, slots=True)
class Switch:
    """Ask a vehicle to enter a state, with its own or with other values of its parameters: in a
    person's command they are text."""

    vehicle: str
    state: str
    values: Values = ()


@dataclass(frozen=True, slots=True)
class SetOption:
    """Ask for another value (SI) of an option."""

    option: str
    value: Any


@dataclass(frozen=True, slots=True)
class Enable:
    """Switch a processor that is no safety part on or off."""

    vehicle: str
    label: str
    on: bool


@dataclass(frozen=True, slots=True)
class Emit:
    """Tell a custom event."""

    name: str


@dataclass(frozen=True, slots=True)
class EnterPhase:
    """Ask a flow to enter a phase."""

    flow: str
    phase: str


@dataclass(frozen=True, slots=True)
class Perform:
    """Ask a vehicle for an act of its driver."""

    vehicle: str
    act: str


@dataclass(frozen=True, slots=True)
class LogText:
    """Tell a text; `{vehicle}`, `{time}` and the event's own fields in it are filled in."""

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


@dataclass(frozen=True, slots=True)
class InputPlan:
    """One entry of `inputs:`. buttons: what the mission calls each of the device's. dead_man: the
    button, by the mission's name, without which nothing is steered; None for none. It is lost when
    it is silent for longer than `silent_after` seconds, and stuck after `stuck_after` (None:
    never)."""

    name: str
    part: PartPlan
    buttons: dict[str, str]
    silent_after: float
    stuck_after: float | None = None
    dead_man: str | None = None
    at: str = ""


@dataclass(frozen=True, slots=True)
class CallbackPlan:
    """One entry of `on:`: when an event called `event` of one of `vehicles` (`""`: of the run) is
    heard whose fields are as `fields` says, and `when` holds, the actions are done in order. One
    that hears nothing (`event` is empty) does them each time that `when` has held for `hold`
    seconds."""

    event: str
    vehicles: tuple[str, ...]
    actions: tuple[ActionPlan, ...]
    fields: tuple[tuple[str, str], ...] = ()
    when: Expression | None = None
    at: str = ""
    hold: float = 0.0


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """One entry of `faults:`: at `time` seconds of the run, or when `when` first holds, `part`
    breaks `vehicle` for `duration` seconds (None: for good)."""

    part: PartPlan
    vehicle: str
    time: float | None = None
    when: Expression | None = None
    duration: float | None = None
    at: str = ""


Arrive = Literal["together", "in_turns"]
"""How the vehicles of a phase arrive: at one time, or one after the other."""


@dataclass(frozen=True, slots=True)
class PhasePlan:
    """One phase of a flow. On entry it gives vehicles to other flows (`give`: vehicle to flow),
    sets options and asks vehicles to enter states (`run`: vehicle to state; `chains`: to the chain
    whose first state that is, where a chain was asked for; `values`: to those that the state is
    entered with in place of its own). `transitions` are
    asked like those of a state: `next` from the top, then `within`; the target `end` ends the flow.
    So does a phase without any, or one that `ends`, when no vehicle that it ran is in its state any
    more. arrive: how the vehicles of `run` arrive, each by itself without it."""

    name: str
    run: dict[str, str]
    give: dict[str, str]
    set: tuple[SetOption, ...]
    transitions: tuple[TransitionPlan, ...]
    chains: dict[str, str] = field(default_factory=dict)
    at: str = ""
    values: dict[str, Values] = field(default_factory=dict)
    ends: bool = False
    arrive: Arrive | None = None


@dataclass(frozen=True, slots=True)
class FlowPlan:
    """Phases over the vehicles that it drives: `vehicles` are those that it has from the start. One
    that `waits` begins when it is given a vehicle."""

    name: str
    begin: str
    vehicles: tuple[str, ...]
    phases: dict[str, PhasePlan]
    waits: bool = False
    at: str = ""


@dataclass(frozen=True, slots=True)
class ExpectationPlan:
    """One line of `expect:`: its text as written, and the parsed expression."""

    text: str
    expression: Expression
    at: str


@dataclass(frozen=True, slots=True)
class SourceFile:
    """One file that the mission was made of: its path as reported and the SHA-256 of its bytes."""

    path: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Plan:
    """A whole mission, ready to fly."""

    mission: str
    summary: str
    target: str
    simulated: bool
    control_rate: int
    hover_limit: float
    time_limit: float
    fence: Box | None
    vehicles: tuple[VehiclePlan, ...]
    expectations: tuple[ExpectationPlan, ...]
    sources: tuple[SourceFile, ...]
    resolved: str
    """The mission after imports, `like`, parameters and defaults, as YAML text."""
    obstacles: dict[str, Shape] = field(default_factory=dict)
    moving: dict[str, MovingSphere] = field(default_factory=dict)
    touchable: frozenset[str] = frozenset()
    """The obstacles that are there to be touched."""
    watching: dict[str, tuple[str, PartPlan]] = field(default_factory=dict)
    """What sees each moving obstacle: a sensor as of a vehicle, with that one's name. One that is
    missing is simulated."""
    points: dict[str, Vec3] = field(default_factory=dict)
    tags: TagMap = NO_TAGS
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    callbacks: tuple[CallbackPlan, ...] = ()
    faults: tuple[FaultPlan, ...] = ()
    flows: tuple[FlowPlan, ...] = ()
    inputs: tuple[InputPlan, ...] = ()
    files: tuple[File, ...] = ()
    """What parameters name, each as it is written in `resolved`."""
