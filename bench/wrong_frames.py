"""Flights in which motion capture's frame is not the declared one, and flights in which it is.

    python bench/wrong_frames.py [SEEDS] [--worlds sim vrpn px4 ardupilot]
                                 [--estimators mocap fusion] [--only WORD] [--unchecked]
    python bench/wrong_frames.py [SEEDS] --false-alarms [--only WORD]

Each rule changes every pose from the first one on; the mission takes off to 1 m, flies 1 m aside,
hovers and lands. The worlds are the simulator, the simulator with poses that a VRPN server sends
(in real time), and both emulated autopilots. Printed, by the simulator's truth, is the worst of the
seeds:

height, side: how far the vehicle rose and got aside, metres. down: the speed at the touch-down,
m/s. up, across: the longest time from lift-off (1 cm), and from the first horizontal speed of
0.3 m/s, to the alarm, seconds; a minus means that the alarm came before. An `!` marks a row that is
beyond the figures: a height of 0.6 m if scale or the up axis is wrong, else 1.1 m; 1 m aside;
1.5 m/s; 0.5 s to the alarm, from lift-off in the former case; a wrong frame that nothing told, or
an alarm in a frame that is right. A vehicle that never leaves the ground needs no alarm. With
`--unchecked` the preflight is ignored, so that what it would find is left to the flight.
`--false-alarms` flies the shipped missions in the lab with
`model_error: 20 %` and without faults, seed by seed, and counts alarms of any supervisor that
judges the vehicle's own state.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from math import hypot, inf, pi
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from toolchain import SHIPPED, compiled, with_library  # noqa: E402
from waiting import free_port  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.core.geometry import Quat, Vec3, from_euler, from_heading, multiply  # noqa: E402
from kybflow.core.signals import Pose, Truth  # noqa: E402
from kybflow.dsl.plan import Plan  # noqa: E402
from kybflow.parts import Effect  # noqa: E402
from kybflow.runtime import engine as engine_module  # noqa: E402
from kybflow.runtime.engine import Engine  # noqa: E402
from kybflow.sensors.vrpn.server import Publish, Server, published, to  # noqa: E402

ALARM = "mocap_frame_wrong"
FALSE_ALARMS = frozenset(
    {
        ALARM, "mocap_frame_unchecked", "poses_rejected", "commands_late", "tilted", "jumped",
        "spinning", "estimate_lost", "ground_touched",
    }
)  # fmt: skip
"""What no flight without faults may raise."""
MISSION = """\
kybflow: 1
mission: wrong_frame
summary: Take off, fly aside, hover, land.
import:
  std: library/airframes.yaml
world:
  fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  nano:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    estimators: [{{use: {estimator}, healthy: age < 250 ms and spread < 5 cm}}]
    behaviors:
      up: {{do: take_off, height: 1 m, then: aside}}
      aside: {{do: fly_to, position: [0.6, 0.8, 1], speed: 50 cm/s, then: hold}}
      hold: {{do: hover, for_time: 3 s, then: down}}
      down: {{do: land}}
targets:
  vrpn:
    all:
      driver: sim
      sensors: {{{estimator}: {{use: vrpn, host: "127.0.0.1:{port}"}}}}
"""
WORLDS = {"sim": "sim", "vrpn": "vrpn", "px4": "emulated_px4", "ardupilot": "emulated_ardupilot"}
"""The target of each world."""
Change = Callable[[Vec3, Quat], tuple[Vec3, Quat]]


def axes(
    *rows: int, factor: float = 1.0, turned: Quat | None = None, stiff: bool = False
) -> Change:
    """Return the change to other axes. rows: for each new axis the old one, from 1, negative for
    its opposite. turned: of the body. stiff: whether the attitude is left as it is."""
    signs = [1.0 if row > 0 else -1.0 for row in rows]
    order = [abs(row) - 1 for row in rows]
    cyclic = (order[1] - order[0]) % 3 == 1
    hand = signs[0] * signs[1] * signs[2] * (1.0 if cyclic else -1.0)

    def change(at: Vec3, attitude: Quat) -> tuple[Vec3, Quat]:
        x, y, z = (factor * s * at[i] for s, i in zip(signs, order, strict=True))
        w, *turn = attitude
        if not stiff:
            attitude = (w, *(hand * s * turn[i] for s, i in zip(signs, order, strict=True)))
        return (x, y, z), attitude if turned is None else multiply(attitude, turned)

    return change


ASIS = (1, 2, 3)
UPSIDE: Quat = (0.0, 1.0, 0.0, 0.0)
RULES: dict[str, Change] = {
    "metres read as mm": axes(*ASIS, factor=1e-3),
    "z-up read as y-up": axes(1, -3, 2),
    "x and y exchanged": axes(2, 1, 3),
    "y mirrored": axes(1, -2, 3),
    "NED read as ENU": axes(2, 1, -3, turned=from_heading(pi / 2)),
    "body turned by 90": axes(*ASIS, turned=from_heading(pi / 2)),
    "body turned by 180": axes(*ASIS, turned=from_heading(pi)),
    "own: mm read as metres": axes(*ASIS, factor=1e3),
    "own: metres read as cm": axes(*ASIS, factor=1e-2),
    "own: feet read as metres": axes(*ASIS, factor=3.281),
    "own: y-up read as z-up": axes(1, 3, -2),
    "own: x-up read as z-up": axes(-3, 2, 1),
    "own: NED positions, ENU attitude": axes(2, 1, -3, stiff=True),
    "own: x mirrored, attitude right": axes(-1, 2, 3, stiff=True),
    "own: exchanged, attitude right": axes(2, 1, 3, stiff=True),
    "own: world turned, attitude right": axes(-2, 1, 3, stiff=True),
    "own: body turned by -90": axes(*ASIS, turned=from_heading(-pi / 2)),
    "own: body upside down": axes(*ASIS, turned=UPSIDE),
    "own: body rolled by 20": axes(*ASIS, turned=from_euler(pi / 9, 0.0, 0.0)),
}
VERTICAL = frozenset(
    {
        "metres read as mm", "z-up read as y-up", "NED read as ENU", "own: mm read as metres",
        "own: metres read as cm", "own: feet read as metres", "own: y-up read as z-up",
        "own: x-up read as z-up", "own: NED positions, ENU attitude", "own: body upside down",
    }
)  # fmt: skip
"""The rules in which scale or the up axis is wrong."""
GOOD: dict[str, Change] = {
    "good: body turned by 30": axes(*ASIS, turned=from_heading(pi / 6)),
    "good: body rolled by 10": axes(*ASIS, turned=from_euler(pi / 18, 0.0, 0.0)),
    "good: scale of 0.9": axes(*ASIS, factor=0.9),
}


@dataclass
class Seen:
    """What flights showed, the worst of them. told: how many had an alarm or a red preflight."""

    height: float = 0.0
    side: float = 0.0
    down: float = 0.0
    up: float = -inf
    across: float = -inf
    told: list[str] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)


class Watch:
    """Looks at every tick of a flight."""

    def __init__(self, change: Change | None = None) -> None:
        self._change = change
        self.height = self.side = self.down = 0.0
        self.lifted: float | None = None
        self.moved: float | None = None
        self._fell, self._high = 0.0, False

    def __call__(self, engine: Engine) -> None:
        if self._change is not None:  # before the preflight, which a plan's faults come after
            for vehicle in engine.vehicles:
                faults = vehicle.knowledge.link_in.faults
                assert faults is not None
                faults.begin(bent(self._change), engine.clock.now)
            self._change = None
        for vehicle in engine.vehicles if engine.flying else ():
            truth = vehicle.truth
            if truth is not None:
                self._look(truth, vehicle.plan.start, engine.seconds())

    def _look(self, truth: Truth, start: Vec3, now: float) -> None:
        x, y, z = (a - b for a, b in zip(truth.position, start, strict=True))
        vx, vy, vz = truth.velocity
        self.height, self.side = max(self.height, z), max(self.side, hypot(x, y))
        self.lifted = now if self.lifted is None and z > 0.01 else self.lifted
        self.moved = now if self.moved is None and hypot(vx, vy) > 0.3 else self.moved
        if z < 0.02 and self._high:
            self.down, self._high = max(self.down, -self._fell), False
        self._high, self._fell = self._high or z > 0.05, vz


def flown(
    plan: Plan, seed: int, change: Change | None = None, unchecked: bool = False, port: int = 0
) -> tuple[Watch, list[Any], Any]:
    """Return what a flight showed, its events and its summary. port: that of the VRPN server that
    sends the changed poses; 0 if the vehicle's own poses are changed."""
    watch = Watch(None if port else change)
    before, check = engine_module._OBSERVED_EVERY, Engine._preflight
    engine_module._OBSERVED_EVERY = 1
    if unchecked:

        def ignored(engine: Engine) -> list[Any]:
            check(engine)
            return []

        Engine._preflight = ignored  # type: ignore[method-assign]
    server = Server(port=port) if port else None
    try:
        if server is not None:
            plan = published(plan, sending(server, change))
        with tempfile.TemporaryDirectory() as folder:
            told: list[Any] = []
            request = RunRequest(seed=seed, out=Path(folder) / "run")
            summary = fly(plan, request, (told.append,), (watch,)).summary
    finally:
        engine_module._OBSERVED_EVERY, Engine._preflight = before, check  # type: ignore[method-assign]
        if server is not None:
            server.close()
    return watch, told, summary


def sending(server: Server, change: Change | None) -> Publish:
    """Return a function that sends changed poses."""
    send = to(server)

    def publish(name: str, pose: Pose) -> None:
        place = (pose.position, pose.attitude)
        send(name, Pose(pose.time, *(place if change is None else change(*place))))

    return publish


def bent(change: Change) -> Effect:
    """Return the effect that changes every pose of a vehicle."""

    def changed(measurement: Any) -> Any:
        if not isinstance(measurement, Pose):
            return measurement
        return Pose(measurement.time, *change(measurement.position, measurement.attitude))

    return Effect(filter=changed)


def study(plan: Plan, change: Change, seeds: int, unchecked: bool, port: int) -> Seen:
    seen, plan = Seen(), replace(plan, expectations=())
    for seed in range(seeds):
        watch, told, summary = flown(plan, seed, change, unchecked, port)
        alarms = [e for e in told if e.name == ALARM]
        reds = [e for e in told if e.name == "preflight_failed"]
        seen.height, seen.side = max(seen.height, watch.height), max(seen.side, watch.side)
        seen.down = max(seen.down, watch.down)
        if alarms:
            at = alarms[0].time / 1e9
            seen.up = max(seen.up, at - (watch.lifted if watch.lifted is not None else at))
            seen.across = max(seen.across, at - (watch.moved if watch.moved is not None else inf))
            seen.told.append(str(alarms[0].fields["reason"]))
        elif reds and not unchecked:
            seen.told.append("preflight: " + str(reds[0].fields["check"]))
        seen.ends.append(str(summary["outcome"]))
    return seen


def is_beyond(rule: str, seen: Seen, seeds: int) -> bool:
    """Return whether a row is beyond the figures."""
    if rule in GOOD:
        return bool(seen.told)
    late = seen.up if rule in VERTICAL else seen.across
    highest = 0.6 if rule in VERTICAL else 1.1
    return (
        seen.height > highest or seen.side > 1.0 or seen.down > 1.5 or late > 0.5
        or (len(seen.told) < seeds and seen.height > 0.01)
    )  # fmt: skip


def say(rule: str, seen: Seen, seeds: int) -> bool:
    """Print a row; return whether it is beyond the figures."""
    why = " | ".join(sorted(set(seen.told)))
    beyond = is_beyond(rule, seen, seeds)
    print(
        f"{'!' if beyond else ' '} {rule:36s} height {seen.height:6.2f}  side {seen.side:5.2f}"
        f"  down {seen.down:5.2f}  up {seen.up:5.2f}  across {seen.across:5.2f}"
        f"  told {len(seen.told)}/{seeds}  {'/'.join(sorted(set(seen.ends)))}  {why}",
        flush=True,
    )
    return beyond


def planned(world: str, estimator: str, port: int) -> Plan:
    """The mission in a world. port: that of the VRPN server."""
    with tempfile.TemporaryDirectory() as folder:
        path = with_library(Path(folder)) / "wrong_frame.yaml"
        text = MISSION.format(estimator=estimator, port=port or 1)
        return compiled(path, text, warns=True, target=WORLDS[world])


def rough(plan: Plan) -> Plan:
    """The plan on vehicles with a model error of 20 %, without faults."""
    vehicles = []
    for vehicle in plan.vehicles:
        params = replace(vehicle.driver.params, model_error=0.2)
        vehicles.append(replace(vehicle, driver=replace(vehicle.driver, params=params)))
    return replace(plan, vehicles=tuple(vehicles), faults=())


def missions(only: str) -> Iterator[tuple[str, Plan]]:
    for path in SHIPPED:
        if only in path.stem:
            yield path.stem, rough(compiled(path, warns=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("seeds", type=int, nargs="?", default=5)
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--estimators", nargs="+", default=["mocap", "fusion"])
    parser.add_argument("--only", default="")
    parser.add_argument("--unchecked", action="store_true")
    parser.add_argument("--false-alarms", action="store_true")
    options = parser.parse_args()
    if options.false_alarms:
        flights = alarms = 0
        plans = list(missions(options.only))
        for seed, (name, plan) in product(range(options.seeds), plans):
            _, told, summary = flown(plan, seed)
            found = [e for e in told if e.name in FALSE_ALARMS]
            flights, alarms = flights + 1, alarms + bool(found)
            for event in found:
                print(name, seed, event.time / 1e9, event.name, event.fields, flush=True)
            print(f"{name}: {summary['outcome']}; {alarms} of {flights} flights", flush=True)
        return
    rows = beyond = 0
    for world, estimator in product(options.worlds, options.estimators):
        port = free_port() if world == "vrpn" else 0
        plan = planned(world, estimator, port)
        print(f"\n{world}, {estimator}", flush=True)
        for rule, change in {**RULES, **GOOD}.items():
            if options.only in rule:
                seen = study(plan, change, options.seeds, options.unchecked, port)
                rows, beyond = rows + 1, beyond + say(rule, seen, options.seeds)
    print(f"\n{beyond} of {rows} rows are beyond the figures")


if __name__ == "__main__":
    main()
