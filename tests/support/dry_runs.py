"""Flights on an emulated autopilot with something going wrong, for the tests of safety.

Take off, hold, land; what goes wrong at `WRONG` seconds is a fault of the plan, or what
a test does to the autopilot itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from typing import Any, NamedTuple

import short_flights
from plans import part, plan, vehicle
from short_flights import down, hold, hovers, path, up

from kybflow.api.flight import Flown, RunRequest, Server, fly
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Event, Time
from kybflow.dsl.plan import FaultPlan, PartPlan
from kybflow.parts import Seat
from kybflow.runtime.engine import Engine

AUTOPILOTS = ("px4", "ardupilot")
WRONG = 7.0
"""Both hover by then, seconds of the run."""
HEIGHT, HOLDS = 0.6, 5.0
LINE, DRIVER, UP = "m.yaml:9", "m.yaml:3", "m.yaml:5"
FOLLOWS = {"px4": "OFFBOARD", "ardupilot": "GUIDED"}
LANDS = {"px4": "AUTO.LAND", "ardupilot": "LAND"}


class Sample(NamedTuple):
    """What the simulator knows at a time, seconds."""

    time: float
    position: Vec3
    mode: str
    armed: bool


def opening(autopilot: str, **params: Any) -> tuple[PartPlan, list[Any]]:
    """(the driver, the sessions that it opened)"""
    own = part("drivers", "emulated_autopilot", autopilot=autopilot, **params)
    opened: list[Any] = []

    class Opening(own.cls):
        preflight_timeout = 6.0

        @classmethod
        def open(cls, seats: Sequence[Seat], generator: Any) -> Any:
            opened.append(super().open(seats, generator))
            return opened[-1]

    return replace(own, cls=Opening, at=DRIVER), opened


def fault(name: str, lasts: float | None = None, at: float = WRONG, **params: Any) -> FaultPlan:
    return short_flights.fault(name, at, lasts, **params)


def supervised(**params: dict[str, Any]) -> tuple[PartPlan, ...]:
    """The default supervisors, those that are named with other parameters."""
    found = hovers().supervisors
    return tuple(
        replace(part("supervisors", one.name, **params[one.name]), at=LINE)
        if one.name in params
        else one
        for one in found
    )


class DryRun:
    """One flight. driver: parameters of the driver. facts: of the vehicle's plan. faults: of the
    plan. deeds: (seconds, what is done to the dry run then). emitted: by the operator. on: an
    event, and what is done when it is told first. servers: who gives commands."""

    def __init__(
        self,
        autopilot: str,
        folder: Any,
        *,
        driver: dict[str, Any] | None = None,
        faults: Sequence[FaultPlan] = (),
        deeds: Sequence[tuple[float, Callable[[DryRun], Any]]] = (),
        emitted: Sequence[tuple[float, str]] = (),
        states: Sequence[Any] | None = None,
        on: tuple[str, Callable[[DryRun], Any]] | None = None,
        servers: Sequence[Server] = (),
        **facts: Any,
    ) -> None:
        self.name, self.told, self.samples = autopilot, [], []
        self.engine: Engine | None = None
        self._on = on
        self._deeds = sorted(deeds, key=lambda deed: deed[0])
        own, self._opened = opening(autopilot, **(driver or {}))
        climb = replace(up("hold", HEIGHT), at=UP)
        one = vehicle(
            "a",
            list(states or [climb, hold(HOLDS, "down"), down()]),
            driver=own,
            tracker=part("trackers", "on_board"),
            **facts,
        )
        numbers = (folder / str(number) for number in count())
        out = next(number for number in numbers if not number.exists())
        request = RunRequest(out=out, emitted=tuple(emitted))
        flight = plan(one, faults=tuple(faults), time_limit=90.0)
        self.flown: Flown = fly(flight, request, (self._hear,), (self._look,), servers)

    @property
    def session(self):
        return self._opened[0]

    @property
    def link(self):
        return self.session.links["a"]

    @property
    def pilot(self):
        """The emulated autopilot."""
        return self.link.onboard

    @property
    def mode(self) -> str:
        return self.pilot.state.flying.name

    @property
    def position(self) -> Vec3:
        return self.link.truth().position

    @property
    def path(self) -> list[str]:
        return path(self.told, "a")

    def events(self, name: str) -> list[Event]:
        return [event for event in self.told if event.name == name]

    def only(self, name: str) -> Event:
        [event] = self.events(name)
        return event

    def at(self, name: str) -> float:
        """When it was told first, seconds."""
        return self.events(name)[0].time / NS

    def after(self, seconds: float, mode: str) -> float:
        """How long after that it was in a mode first."""
        return next(s.time for s in self.samples if s.time >= seconds and s.mode == mode) - seconds

    def do_next(self, deed: Callable[[DryRun], Any]) -> None:
        """Do this in the next tick that is looked at."""
        self._deeds.insert(0, (self.engine.seconds() + 0.001, deed))

    def go_on(self, seconds: float) -> None:
        """Time passes for the vehicle alone: this program is dead."""
        now: Time = self.engine.clock.now
        for tick in range(1, round(250 * seconds) + 1):
            self.session._fleet.advance(now + tick * NS // 250)
            if tick % 12 == 0:
                self._sample((now + tick * NS // 250) / NS)

    def hang(self, seconds: float, late_poses: bool = False) -> None:
        """This process hangs. late_poses: the poses of that time are lost to it."""
        self.go_on(seconds)
        self.engine.clock.now += round(seconds * NS)
        if late_poses:
            self.session._fleet.members[0]._poses.clear()

    def is_safe(self, wide: float = 0.3, high: float = HEIGHT + 0.15) -> bool:
        """It is down, its rotors rest, it has never been far from above its start."""
        assert not self.pilot.state.armed
        assert self.position[2] < 0.05
        far = max(max(abs(s.position[0]), abs(s.position[1])) for s in self.samples)
        top = max(s.position[2] for s in self.samples)
        assert far < wide, far
        assert top < high, top
        return True

    def _hear(self, event: Event) -> None:
        self.told.append(event)
        if self._on is not None and event.name == self._on[0]:
            self._on, (_, deed) = None, self._on
            deed(self)

    def _look(self, engine: Engine) -> None:
        self.engine = engine
        self._sample(engine.seconds())
        while self._deeds and engine.seconds() >= self._deeds[0][0]:
            self._deeds.pop(0)[1](self)

    def _sample(self, seconds: float) -> None:
        truth, state = self.link.truth(), self.pilot.state
        place = ZERO if truth is None else truth.position
        self.samples.append(Sample(seconds, place, state.flying.name, state.armed))
