"""Coordinators: one law over several vehicles, which gives each of them one value a tick."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from kybflow.core.signals import Estimate, SeenObjects, Time
from kybflow.parts.base import Objection, P, Part
from kybflow.world.objects import WorldObject
from kybflow.world.vehicle_context import VehicleContext

Team = Mapping[str, VehicleContext]
"""The vehicles of a phase, by name."""


class TeamMember(NamedTuple):
    """A vehicle of the phase. pushes: the surface, `OBJECT.SURFACE`, against which its behavior
    presses now; None if it presses against nothing."""

    estimate: Estimate | None
    pushes: str | None


class TeamTick(NamedTuple):
    """The input of a coordinator in one tick.

    now: the tick's time. dt: its duration, s. objects: the objects of the world that motion capture
    tracks. members: the vehicles that the phase runs, by name.
    """

    now: Time
    dt: float
    objects: SeenObjects
    members: Mapping[str, TeamMember]


class Shares(NamedTuple):
    """What a coordinator gives. values: each vehicle's value; a vehicle without one lets go. state:
    what the coordinator does, in one word; an event reports a change. reason: why, in words."""

    values: Mapping[str, float]
    state: str
    reason: str = ""


class Coordinator(Part[P]):
    """One law over the vehicles that a phase of a flow runs, like the sharing of a load. It reads
    their states and the objects of the world, and gives each vehicle one value, which its behavior
    reads as `tick.share` in the next tick.

    Exists while the phase is active. If it raises, its flow ends, and the vehicles no longer have a
    value.
    """

    kind = "coordinators"

    def __init__(self, params: P, team: Team) -> None:
        self.params = params

    @abstractmethod
    def update(self, tick: TeamTick) -> Shares:
        """Return each vehicle's value. Called once a tick, after every vehicle has acted."""

    @classmethod
    def goals(
        cls, params: P, objects: Mapping[str, WorldObject]
    ) -> Iterator[tuple[str, str, float]]:
        """Yield the goals that it leads objects to, for the report: (object, what conditions call
        its coordinate, value in SI)."""
        yield from ()

    @classmethod
    def objections(cls, params: P, team: Team) -> Iterator[Objection]:
        """Yield why these parameters make no sense for the vehicles of a phase."""
        yield from ()
