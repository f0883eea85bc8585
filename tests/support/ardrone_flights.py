"""Missions on emulated AR.Drones, with what their session was."""

from __future__ import annotations

from dataclasses import replace

from toolchain import compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import read_commands
from kybflow.drivers.ardrone.wire import CommandStream
from kybflow.drivers.emulated_ardrone import EmulatedArdrone
from kybflow.drivers.emulated_ardrone.drone import OnboardDrone

HEAD = """kybflow: 1
mission: drones
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
vehicles:
"""
VEHICLE = """  {name}:
    like: std.ardrone
    start: {{at: [{x}, 0, 0]}}
    behaviors:
      up: {{do: take_off, height: 1 m, then: turn, within: 20 s}}
      turn: {{do: circle, center: [{x}, 0.5, 1], radius: 50 cm, speed: 40 cm/s, laps: {laps},
             then: down}}
      down: {{do: land}}
"""


def mission(names, seconds):
    """Each takes off, circles for about so long, and lands."""
    laps = max(1, round(seconds * 0.4 / 3.14))
    vehicles = (
        VEHICLE.format(name=name, x=1.5 * number - 1.5, laps=laps)
        for number, name in enumerate(names)
    )
    return HEAD + "".join(vehicles)


def drone_flight(text, out, *, request=None, seed=0, breaks=(), watch=None, **params):
    """The flight, its events, and the session. breaks: (seconds, failures of the drone `a`).
    watch: takes (seconds, truth) of the drone `a`, once a tick."""
    plan = compiled(out / "drones.yaml", text, target="emulated_ardrone", warns=True)
    sessions = []

    class Kept(EmulatedArdrone):
        @classmethod
        def open(cls, seats, generator):
            sessions.append(broken(EmulatedArdrone.open(seats, generator), breaks, watch))
            return sessions[-1]

    def on(vehicle):
        changed = replace(vehicle.driver.params, **params)
        return replace(vehicle, driver=replace(vehicle.driver, cls=Kept, params=changed))

    plan = replace(plan, vehicles=tuple(map(on, plan.vehicles)))
    told = []
    request = request or RunRequest(out=out / "run", seed=seed)
    flight = fly(plan, request, (told.append,))
    return flight, told, sessions[0]


def succeeded(*words, **params):
    """A `drone_flight`, which must succeed."""
    flight, told, session = drone_flight(*words, **params)
    assert flight.summary["outcome"] == "succeeded", told
    return flight, told, session


def broken(session, breaks, watch):
    """The session, whose drone `a` fails at these times."""
    advance, waiting = session.advance, sorted(breaks, key=lambda one: one[0])

    def breaking(now):
        while waiting and waiting[0][0] * NS <= now:
            for name, value in waiting.pop(0)[1].items():
                setattr(session.links["a"].drone.failures, name, value)
        advance(now)
        if watch is not None:
            watch.append((now / NS, session.links["a"].truth()))

    session.advance = breaking
    return session


class AgesOnReceipt:
    """How old each move was as a drone took it: `seconds`, from the tick that made it, by the clock
    of the stream that sent it. `most_held`: the age of the oldest that was sent, as the stream saw
    it."""

    def __init__(self, monkeypatch):
        self.seconds, self.most_held, self._made = [], 0.0, {}
        due, execute = CommandStream.due, OnboardDrone._execute

        def noting_due(stream):
            held, clock, judged = stream._held, stream._clock, []
            stream._clock = lambda: judged.append(clock()) or judged[-1]
            try:
                sent = due(stream)
            finally:
                stream._clock = clock
            if held is None or stream._held is not held:
                return sent  # the tick made another meanwhile
            for command in (c for data in sent for c in read_commands(data)):
                if command.name == "PCMD" and command.arguments[0]:
                    self._made[command.sequence, command.arguments] = held.at, clock
                    self.most_held = max(self.most_held, (judged[0] - held.at) / NS)
            return sent

        def noting_execute(drone, command):
            made, clock = self._made.get((command.sequence, command.arguments), (None, None))
            if made is not None:
                self.seconds.append((clock() - made) / NS)
            execute(drone, command)

        monkeypatch.setattr(CommandStream, "due", noting_due)
        monkeypatch.setattr(OnboardDrone, "_execute", noting_execute)
