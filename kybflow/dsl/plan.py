"""The plan: what a mission means, frozen, in SI, with no YAML left. The only thing that the runtime
sees.

It can be built in a test without YAML. `at` is always `file:line` of the text that a value came
from, for events and reports; it is empty for what nobody wrote.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from kybflow.dsl.expressions import Expression
from kybflow.geometry import Vec3
from kybflow.parts import Leg
from kybflow.site import Airframe, Box

Cause = Literal["next", "then", "failed", "within"]


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
    """One arrow out of a state.

    `next` fires when `when` has held for `hold` seconds, or `event` is heard, or `after` seconds
    have passed in the
    state (those that are given, together); `then` when the behavior is done; `failed` when it
    failed; `within` after `after` seconds. `implied` arrows are those that the language adds.
    """

    cause: Cause
    target: str
    when: Expression | None = None
    event: str | None = None
    after: float | None = None
    hold: float = 0.0
    implied: bool = False
    at: str = ""


@dataclass(frozen=True, slots=True)
class StatePlan:
    """One state of a vehicle: a behavior and its arrows, in the order in which they are asked."""

    name: str
    behavior: PartPlan
    legs: tuple[Leg, ...]
    transitions: tuple[TransitionPlan, ...]
    built_in: bool = False
    at: str = ""


@dataclass(frozen=True, slots=True)
class EstimatorPlan:
    """An estimator with its health: healthy while the condition holds, and again only after
    `recover_after` seconds."""

    part: PartPlan
    healthy: Expression | None
    recover_after: float
    for_at_most: float | None


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


@dataclass(frozen=True, slots=True)
class ExpectationPlan:
    """One line of `expect:`, as written and as meant."""

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
