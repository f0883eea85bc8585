"""How calm vehicles stay at the edges of their processors.

    python bench/edges.py FIRST COUNT

Flies COUNT flights without faults, numbered from FIRST, without those that the compiler refuses
because they lead through the pillar; the number is the seed of a flight and of
the draw of its mission: on the default processors or with `avoid_obstacles`, past a pillar and
back, or to a point next to the fence, at a speed and an acceleration within or beyond the limits;
in every other one, a limit is changed in mid-flight. Prints each flight that breaks a bound, and
the worst of all, by the simulator's truth: the tilt beyond the airframe's limit (3 degrees are
allowed), the distance from the setpoint in flight (15 cm), and the room left around the hull.
"""

from __future__ import annotations

import argparse
import itertools
import random
import tempfile
from math import degrees
from pathlib import Path

from kybflow.api.flight import RunRequest, fly
from kybflow.core.geometry import distance, tilt_of
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

STEEPER, FARTHEST = 3.0, 0.15
AIRFRAMES = ("courier_quad", "mk_quadro", "nano_plus", "x500")
CHANGES = (
    ("limit_speed", "speed", "30 cm/s", "1 m/s"),
    ("limit_acceleration", "acceleration", "0.4 m/s^2", "2 m/s^2"),
    ("obstacle_guard", "keep", "30 cm", "10 cm"),
    ("fence", "margin", "60 cm", "20 cm"),
)
MISSION = """kybflow: 1
mission: edges
import: {{std: kybflow/airframes}}
world:
  fence: {{from: [-3, -3, 0], to: [3, 3, 2.5]}}
  obstacles: {{pillar: {{cylinder: {{at: [0, {aside:.3f}, 0], radius: 20 cm, height: 2.5 m}}}}}}
vehicles:
  q:
    like: std.{airframe}
    start: {{at: [-2, 0, 0]}}
{processors}    behaviors:
      up:    {{do: take_off, height: 1.2 m, then: there, within: 20 s}}
      there: {{do: fly_to, position: {goal}, speed: {speed:.2f} m/s, then: back, failed: back, next: [{{after: {after:.1f} s, go: back}}]}}
      back:  {{do: fly_to, position: [-2, 0, 1], speed: {speed:.2f} m/s, then: down, failed: down, next: [{{after: 12 s, go: down}}]}}
      down:  {{do: land}}
{changes}"""  # noqa: E501 - as a mission is written


def mission(seed: int) -> str:
    """Return the text of the mission with this number."""
    draw = random.Random(seed)
    goes_round = draw.random() < 0.3
    listed = "limit_speed, limit_acceleration, avoid_obstacles, fence"
    goal = draw.choice(("[2, 0, 1.2]", "[2, 0.3, 1]", "[-2, 2.78, 1.2]", "[2.75, -1, 2.25]"))
    text, first = "", draw.choice(CHANGES)
    if draw.random() < 0.5 and not (goes_round and first[0] == "obstacle_guard"):
        part, option, *values = first
        if draw.random() < 0.5:
            values.reverse()
        text = "on:\n"
        for state, value in zip(("there", "back"), values, strict=True):
            asked = f"set: {{q.processors.{part}.{option}: {value}}}"
            text += f"  - {{event: q.behavior_started, behavior: {state}, do: [{{{asked}}}]}}\n"
    return MISSION.format(
        aside=draw.uniform(-0.9, 0.9),
        airframe=draw.choice(AIRFRAMES),
        processors=f"    processors: [{listed}]\n" if goes_round else "",
        goal=goal,
        speed=draw.uniform(0.3, 1.0),
        after=draw.uniform(2.0, 10.0),
        changes=text,
    )


class Calm:
    """An observer of a run. steeper: degrees of tilt beyond the airframe's. off, room: metres."""

    def __init__(self) -> None:
        self.steeper, self.off, self.room = -90.0, 0.0, 9.0

    def __call__(self, engine: Engine) -> None:
        (vehicle,) = engine.vehicles
        truth, followed, frame = vehicle.truth, vehicle.followed, vehicle.context.airframe
        if truth is None or not vehicle.airborne:
            return
        self.steeper = max(self.steeper, degrees(tilt_of(truth.attitude) - frame.tilt))
        for shape in vehicle.context.obstacles.values():
            self.room = min(self.room, shape.distance(truth.position) - frame.hull)
        if vehicle.runner.stays_in_air and followed is not None and followed.position is not None:
            self.off = max(self.off, distance(followed.position, truth.position))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    chosen, catalog = parser.parse_args(), load_catalog()
    broken, flown, worst = 0, 0, Calm()
    for seed in itertools.count(chosen.first):
        if flown == chosen.count:
            break
        calm = Calm()
        with tempfile.TemporaryDirectory() as place:
            path = Path(place) / "edges.yaml"
            path.write_text(mission(seed), encoding="utf-8")
            result = compile_mission(path, catalog=catalog)
            if result.plan is None:  # it would fly through the pillar
                continue
            flown += 1
            request = RunRequest(out=Path(place) / "run", seed=seed)
            summary = fly(result.plan, request, observers=(calm,)).summary
        worst.steeper, worst.off = max(worst.steeper, calm.steeper), max(worst.off, calm.off)
        worst.room = min(worst.room, calm.room)
        touched = calm.room < 0.0 or "ran into" in str(summary.get("reason"))
        if calm.steeper > STEEPER or calm.off > FARTHEST or touched:
            broken += 1
            print(f"{seed:5d} {_shown(calm)}  {summary.get('reason') or ''}", flush=True)
    print(f"  all {_shown(worst)}  {broken} of {chosen.count} broke a bound")


def _shown(calm: Calm) -> str:
    return f"{calm.steeper:+6.1f} deg beyond, {calm.off * 100:5.1f} cm off, {calm.room:.3f} m left"


if __name__ == "__main__":
    main()
