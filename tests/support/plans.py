"""Plans built without YAML, for tests of the runtime."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from part_bench import AIRFRAME

from kybflow.core.signals import Command, Measurement, MeasurementKind, Time, Truth
from kybflow.drivers.sim import Sim
from kybflow.dsl.plan import EstimatorPlan, PartPlan, Plan, StatePlan, TransitionPlan, VehiclePlan
from kybflow.dsl.world import Obstacle, World
from kybflow.parts import Behavior, Leg, Link, Seat, Session
from kybflow.parts.catalog import load_catalog
from kybflow.world.shapes import Box

NANO = AIRFRAME
FENCE = Box((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5))


def part(kind: str, name: str, **params: Any) -> PartPlan:
    """A part of the catalog with these parameters (SI)."""
    spec = load_catalog().get(kind, name)
    return PartPlan(name, spec.cls, spec.params(**params), f"{kind}.{name}")


class Through(Link):
    """Passes everything on to a simulated vehicle's link; tests override what they change."""

    def __init__(self, link: Any) -> None:
        self.link, self.faults = link, link.faults

    def read(self, now: Time) -> Sequence[Measurement]:
        measured: Sequence[Measurement] = self.link.read(now)
        return measured

    def send(self, command: Command, now: Time) -> None:
        self.link.send(command, now)

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        self.link.subscribe(kinds)

    def truth(self) -> Truth | None:
        truth: Truth | None = self.link.truth()
        return truth


def wrapped(wrap: Callable[[str, Link], Link], **declared: Any) -> PartPlan:
    """The simulator, each vehicle's link replaced by what `wrap` makes of it; `declared` is what
    the driver says of itself, such as `lands`."""

    class Wrapped(Sim):
        @classmethod
        def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
            session = super().open(seats, generator)
            session.links = {name: wrap(name, link) for name, link in session.links.items()}
            return session

    for name, value in declared.items():
        setattr(Wrapped, name, value)
    return replace(part("drivers", "sim"), cls=Wrapped)


class Bent(Link):
    """A link to a simulated vehicle whose measurements pass `bend`, which may return None."""

    def __init__(self, link: Link, bend: Callable[[Any, int], Any]) -> None:
        self.link, self.bend = link, bend

    def read(self, now: int) -> list[Any]:
        return [bent for m in self.link.read(now) if (bent := self.bend(m, now)) is not None]

    def send(self, command: Any, now: int) -> None:
        self.link.send(command, now)

    def truth(self) -> Any:
        return self.link.truth()


def bent(bend: Callable[[Any, int], Any]) -> PartPlan:
    """The simulator, each vehicle's measurements bent."""
    return replace(wrapped(lambda _, link: Bent(link, bend)), at="m.yaml:9")


def in_still_air(plan: Plan) -> Plan:
    """The plan in a simulator without a lab's disturbances."""
    flying = []
    for vehicle in plan.vehicles:
        params = replace(vehicle.driver.params, calm=True)
        flying.append(replace(vehicle, driver=replace(vehicle.driver, params=params)))
    return replace(plan, vehicles=tuple(flying))


def state(
    name: str, behavior: PartPlan | type[Behavior[Any]], *arrows: TransitionPlan, **more: Any
) -> StatePlan:
    """A state; a behavior's class stands for it with no parameters."""
    if isinstance(behavior, type):
        behavior = PartPlan(behavior.__name__, behavior, None, "")
    behavior = replace(behavior, label=f"behaviors.{name}")
    legs: tuple[Leg, ...] = behavior.cls.flight
    return StatePlan(name, behavior, legs, arrows, **more)


def then(target: str) -> TransitionPlan:
    return TransitionPlan(target=target, cause="then")


def failed(target: str) -> TransitionPlan:
    return TransitionPlan(target=target, cause="failed")


def after(seconds: float, target: str) -> TransitionPlan:
    return TransitionPlan(target=target, after=seconds)


def on(event: str, target: str) -> TransitionPlan:
    return TransitionPlan(target=target, event=event)


def built_in_states(hover_limit: float = 30.0) -> list[StatePlan]:
    """As the compiler adds them to every vehicle."""
    more: dict[str, Any] = {"built_in": True}
    waits, land = part("behaviors", "wait_on_ground"), part("behaviors", "land")
    hover, home = part("behaviors", "hover"), part("behaviors", "go_home")
    lands = failed("auto_land")
    return [
        state("landed", waits, **more),
        state("brake", part("behaviors", "brake"), then("hover"), lands, **more),
        state("hover", hover, after(hover_limit, "auto_land"), lands, **more),
        state("auto_home", home, then("auto_land"), lands, **more),
        state("auto_land", land, then("landed"), failed("land_blind"), **more),
        state("land_blind", part("behaviors", "land_blind"), then("fault"), **more),
        state("fault", waits, **more),
    ]


def vehicle(name: str, states: list[StatePlan], **more: Any) -> VehiclePlan:
    """A nano_plus; every state without `then` or `failed` gets the implied arrows' targets."""
    supervisors = tuple(
        part("supervisors", spec.name) for spec in load_catalog().always("supervisors")
    )
    every = [*states, *built_in_states(more.get("hover_limit", 30.0))]
    facts: dict[str, Any] = {
        "airframe": NANO,
        "start": (0.0, 0.0, 0.0),
        "heading": 0.0,
        "estimators": (EstimatorPlan(part("estimators", "mocap"), recover_after=1.0),),
        "processors": tuple(part("processors", n) for n in ("position_error", "fence")),
        "tracker": part("trackers", "cascade"),
        "supervisors": supervisors,
        "driver": part("drivers", "sim"),
        "begin": states[0].name,
        **more,
    }
    return VehiclePlan(name=name, states={s.name: s for s in every}, **facts)


def plan(*vehicles: VehiclePlan, **more: Any) -> Plan:
    obstacles = more.get("obstacles", {})
    facts: dict[str, Any] = {
        "mission": "test",
        "summary": "",
        "target": "sim",
        "simulated": True,
        "control_rate": 250,
        "hover_limit": 30.0,
        "time_limit": 60.0,
        "fence": FENCE,
        "expectations": (),
        "sources": (),
        "resolved": "",
        "world": World(
            obstacles=tuple(Obstacle(name=name, shape=shape) for name, shape in obstacles.items())
        ),
        **more,
    }
    return Plan(vehicles=vehicles, **facts)
