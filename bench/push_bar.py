"""Flights of two vehicles that push a bar: disturbed, on other bodies, and with what breaks.

    python bench/push_bar.py [CASE ...] [--seeds 20] [--first 0]

Every flight of `missions/push_bar.yaml` has a start angle of the bar within 25 degrees and, unless
something breaks, disturbances of 0.3 s every 5 to 9 s, up to 2 N on the car against the push or
0.3 N m on the bar, the last one 15 s before the end. Printed by the simulator's truth:

first: the bar's yaw when it is first pushed, deg. most: the largest yaw while it is pushed, deg.
car, yaw: the errors at the end, cm and deg. broken: how often a contact was lost for more than
0.2 s outside of disturbances. Where something breaks: let go: the time from the end of one
vehicle's push to that of the other, s; turned: how far the bar turned after that, deg. hits: how
often a vehicle ran into anything.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from toolchain import compiled, with_library  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.core.signals import Event  # noqa: E402
from kybflow.drivers.sim import world as simulator  # noqa: E402
from kybflow.runtime import engine as engine_module  # noqa: E402
from kybflow.runtime.engine import Engine  # noqa: E402
from kybflow.world.objects import WorldObject  # noqa: E402

MISSION = (ROOT / "missions" / "push_bar.yaml").read_text()
GOAL, HELD_S = 1.0, 60.0
BEGIN_S, PAUSE_S = 12.0, 15.0
BROKEN_S = 0.2
AT_BREAK = 0.3
"""Where the car is when something breaks, m: in mid push."""
Objects = Mapping[str, WorldObject]


class Case(NamedTuple):
    """A kind of flight. breaks: a fault, as a line of the mission. signs: of the disturbances of
    the car. body: what the objects really are. disturbs: whether there are disturbances."""

    target: str | None = None
    breaks: str = ""
    signs: tuple[int, ...] = (-1,)
    edits: tuple[tuple[str, str], ...] = ()
    body: Callable[[Objects], Objects] | None = None
    disturbs: bool = True


def heavier(objects: Objects) -> Objects:
    return {name: one._replace(mass=1.5 * one.mass) for name, one in objects.items()}


def rougher(objects: Objects) -> Objects:
    joint: Any = objects["car"].joint
    car = objects["car"]._replace(joint=replace(joint, friction=1.5 * joint.friction))
    return {**objects, "car": car}


def _breaks(fault: str) -> Case:
    line = f"  - {{inject: {fault}, on: left, when: car.position > {AT_BREAK} m}}"
    return Case(breaks=line, disturbs=False)


_HULL = ("like: std.ardrone_hull", "like: std.ardrone_hull\n    airframe: {bumper_height: 5 cm}")
_STOP = (
    ("to: 3 m", "to: 1.5 m"), ("position: $goal", "position: 1.5 m"),
    ("$goal + 4 cm, for: 3 s", "1.4 m, for: 60 s"),
)  # fmt: skip
CASES = {
    "disturbed": Case(),
    "both_signs": Case(signs=(-1, 1)),
    "ardrone": Case(target="emulated_ardrone"),
    "heavier": Case(body=heavier),
    "friction": Case(body=rougher),
    "hull": Case(edits=(_HULL,)),
    "lost": _breaks("rotor_weak, left: 0.2"),
    "link": _breaks("link_cut"),
    "mocap": _breaks("mocap_dropout"),
    "stop": Case(edits=_STOP, disturbs=False),
}  # fmt: skip


def disturbances(generator: random.Random, case: Case) -> list[tuple[float, str]]:
    """Return the time and the line of each disturbance."""
    found: list[tuple[float, str]] = []
    time = BEGIN_S + generator.uniform(5.0, 9.0)
    while time < HELD_S + BEGIN_S - 7.0 - PAUSE_S:
        if generator.random() < 0.5:
            force = generator.choice(case.signs) * generator.uniform(0.5, 2.0)
            what = f"object: car, force: [{force:.3f} N, 0 N, 0 N]"
        else:
            what = f"object: bar, torque: {generator.choice((-0.3, 0.3))} N m"
        line = f"  - {{inject: push_object, {what}, on: left, at: {time:.3f} s, for: 0.3 s}}"
        found.append((time, line))
        time += generator.uniform(5.0, 9.0)
    return found


class Watch:
    """Observes one flight. disturbed: the times of the disturbances."""

    def __init__(self, disturbed: list[float]) -> None:
        self.disturbed = disturbed
        self.first: float | None = None
        self.most = self.car = self.yaw = 0.0
        self.broken = 0
        self.ended: dict[str, float] = {}
        self.at_end: float | None = None
        self.turned = 0.0
        self.aligned_s = self.arrived_s = -1.0
        self.states: list[str] = []
        self._apart: dict[str, float] = {}

    def __call__(self, engine: Engine) -> None:
        if not engine.flying:
            return
        now, states = engine.seconds(), engine.true_objects.states
        q, yaw = states["car"].q, degrees(states["bar"].q)
        self._measure(engine, now, q, yaw)
        self._contacts(engine, now, q)
        if self.ended:
            self.at_end = yaw if self.at_end is None else self.at_end
            if now - min(self.ended.values()) < 5.0:
                self.turned = max(self.turned, abs(yaw - self.at_end))

    def _measure(self, engine: Engine, now: float, q: float, yaw: float) -> None:
        """Take the errors of the object."""
        self.car, self.yaw = 100.0 * (q - GOAL), yaw
        does = engine.flows.running("work").coordinated
        if does == "push" and self.first is None:
            self.first, self.aligned_s = yaw, now
        if does == "push":
            self.most = max(self.most, abs(yaw))
        if self.arrived_s < 0.0 and abs(self.car) < 5.0:
            self.arrived_s = now

    def _contacts(self, engine: Engine, now: float, q: float) -> None:
        """Count broken contacts, and take when each vehicle no longer pushes."""
        quiet = all(not -0.1 < now - time < 2.0 for time in self.disturbed)
        self.states = [vehicle.state for vehicle in engine.vehicles]
        touching = {contact.vehicle for contact in engine.contacts.forces}
        for vehicle in engine.vehicles:
            name, pushes = vehicle.name, vehicle.as_member().pushes is not None
            if pushes:
                if len(self.ended) < len(engine.vehicles):
                    self.ended.pop(name, None)
                apart = 0.0 if name in touching else self._apart.get(name, 0.0) + 0.02
                if quiet and apart >= BROKEN_S > self._apart.get(name, 0.0):
                    self.broken += 1
                self._apart[name] = apart
            elif q > AT_BREAK and name not in self.ended:
                self.ended[name] = now


def flight(case: Case, seed: int) -> tuple[Watch, Mapping[str, Any], list[Event]]:
    """Fly one case with one seed."""
    generator = random.Random(seed)
    start = generator.uniform(-25.0, 25.0)
    drawn = disturbances(generator, case) if case.disturbs else []
    text = MISSION.replace("default: 20 deg", f"default: {start:.2f} deg")
    for old, new in case.edits:
        text = text.replace(old, new)
    lines = "\n".join([line for _, line in drawn] + ([case.breaks] if case.breaks else []))
    if lines:
        text = text.replace("\nexpect:", f"\nfaults:\n{lines}\n\nexpect:")
    real, body = simulator.objects_text, case.body or (lambda objects: objects)
    watch, told = Watch([time for time, _ in drawn]), list[Event]()
    with tempfile.TemporaryDirectory() as folder:
        path = with_library(Path(folder)) / "push_bar.yaml"
        plan = compiled(path, text, warns=True, target=case.target)
        with (
            mock.patch.object(simulator, "objects_text", lambda objects: real(body(objects))),
            mock.patch.object(engine_module, "_OBSERVED_EVERY", 20_000_000),
        ):
            request = RunRequest(seed=seed, out=Path(folder) / "run")
            flown = fly(plan, request, (told.append,), (watch,))
    failed = [event.fields for event in told if event.name == "observer_failed"]
    if failed:
        raise RuntimeError(failed)
    return watch, flown.summary, told


def line_of(case: Case, watch: Watch, told: list[Event]) -> str:
    """Return what a flight showed."""
    states = "/".join(watch.states)
    hits = sum(event.name == "collided" for event in told)
    if not case.disturbs:
        times = sorted(watch.ended.values())
        let_go = times[1] - times[0] if len(times) > 1 else float("nan")
        return f"let go {let_go:5.2f}  turned {watch.turned:4.1f}  {states}  {hits} hits"
    first = float("nan") if watch.first is None else watch.first
    return (
        f"first {first:5.1f}  most {watch.most:4.1f}  car {watch.car:5.1f}  yaw {watch.yaw:5.1f}"
        f"  broken {watch.broken}  aligned {watch.aligned_s:4.1f} s  there {watch.arrived_s:4.1f} s"
        f"  {states}  {hits} hits"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", default=list(CASES), choices=[*CASES, []])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    for name in options.cases:
        for seed in range(options.first, options.first + options.seeds):
            watch, summary, told = flight(CASES[name], seed)
            shown = line_of(CASES[name], watch, told)
            end = summary["reason"] or summary["outcome"]
            print(f"{name:10s} {seed:3d} {shown}  {end}", flush=True)


if __name__ == "__main__":
    main()
