"""Flights on a real autopilot's simulator, looked at from outside while they go on."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from toolchain import compiled, flight_of
from witness import Watched, Witness

from kybflow.api.flight import Flown
from kybflow.core.geometry import Vec3, add
from kybflow.core.signals import Event, Measurement, Time, Truth
from kybflow.drivers.mavlink import link
from kybflow.drivers.mavlink.transport.sockets import open_wire
from kybflow.drivers.mavlink.transport.wire import Received, Wire
from kybflow.dsl.plan import Plan
from kybflow.parts import Link, Stream
from kybflow.runtime.engine import Engine
from kybflow.sensors.simulated_motion_capture import SimulatedMotionCapture
from kybflow.world.vehicle_context import VehicleContext

HERE = Path(__file__).parent
ASIDE = (1.0, 0.0, 0.0)
ASKED = tuple(
    name for name in os.environ.get("KYBFLOW_FIRMWARE", "").replace(" ", "").split(",") if name
)


def shown(*words: object) -> None:
    """A measured figure, for the closing report of the tests (`-rP`)."""
    sys.stdout.write(" ".join(map(str, words)) + "\n")


def plan_of(path: Path, target: str) -> Plan:
    return compiled(path, target=target, warns=True)


def full_flight(
    plan: Plan, out: Path, *looks: Callable[[Engine], None]
) -> tuple[Flown, list[Event], Engine]:
    """Fly a plan to its end. Who looks on must not raise."""
    engines: list[Engine] = []
    flight, told = flight_of(plan, out, engines.append, *looks)
    assert [e.fields for e in told if e.name == "observer_failed"] == []
    return flight, told, engines[-1]


def first(told: Sequence[Event], name: str, vehicle: str) -> Event | None:
    return next((e for e in told if e.name == name and e.vehicle == vehicle), None)


class Room:
    """Motion capture of the room, which sees the vehicles by `watched` in place of their links
    where that is given, falls silent for good when it is told to, and sees one metre to the side.
    `last`: the time of the last pose of each."""

    def __init__(
        self, watched: dict[str, Watched] | None = None, witness: Witness | None = None
    ) -> None:
        self.silent: set[str] = set()
        self.mistaken: set[str] = set()
        self.last: dict[str, Time] = {}
        self._watched, self._witness = watched or {}, witness

    def look(self, now: Time) -> None:
        if self._witness is not None and now != self._witness.now:
            self._witness.look(now)

    def into(self, plan: Plan) -> Plan:
        """The plan with this in place of its motion capture."""
        room = self

        class InTheRoom(SimulatedMotionCapture):
            @classmethod
            def open(cls, params, context, link, generator):
                seen = _Seen(room._watched[context.vehicle], context) if room._watched else link
                return _Silenced(
                    super().open(params, context, seen, generator), context.vehicle, room
                )

        def replaced(sensor):
            if sensor.part.cls is not SimulatedMotionCapture:
                return sensor
            return dataclasses.replace(sensor, part=dataclasses.replace(sensor.part, cls=InTheRoom))

        vehicles = tuple(
            dataclasses.replace(v, sensors=tuple(replaced(s) for s in v.sensors))
            for v in plan.vehicles
        )
        return dataclasses.replace(plan, vehicles=vehicles)


class _Silenced(Stream):
    def __init__(self, stream: Stream, vehicle: str, room: Room) -> None:
        self._stream, self._vehicle, self._room = stream, vehicle, room

    def read(self, now: Time) -> Sequence[Measurement]:
        self._room.look(now)
        came = self._stream.read(now)
        if self._vehicle in self._room.silent:
            return ()
        if came:
            self._room.last[self._vehicle] = came[-1].time
        if self._vehicle in self._room.mistaken:
            return [m._replace(position=add(m.position, ASIDE)) for m in came]
        return came

    def close(self) -> None:
        self._stream.close()


class _Seen(Link):
    """A link that can only be seen, through the other connection."""

    def __init__(self, watched: Watched, context: VehicleContext) -> None:
        self._truth = watched.behold(context)
        self._now: Time = 0
        self._watched = watched

    def read(self, now: Time) -> Sequence[Measurement]:
        return ()

    def send(self, command, now: Time) -> None:
        raise AssertionError("nothing is sent to what is only seen")

    def truth(self) -> Truth | None:
        return self._truth.truth(self._watched.now)


class Wires:
    """The wires of a mission, all cut and joined together by `is_cut`."""

    def __init__(self, monkeypatch) -> None:
        self.is_cut = False
        true = link.open_session
        monkeypatch.setattr(link, "open_session", lambda seats: true(seats, self._open))

    def _open(self, address: str) -> Wire:
        wire = open_wire(address)
        receive, send = wire.receive, wire.send

        def received(now: Time) -> Received:
            came = receive(now)
            return () if self.is_cut else came

        wire.receive = received
        wire.send = lambda data, to=None: None if self.is_cut else send(data, to)
        return wire


def level_drift(here: Vec3, there: Vec3) -> float:
    return ((here[0] - there[0]) ** 2 + (here[1] - there[1]) ** 2) ** 0.5
