"""Every processor: what it puts out is smooth, however it bends what is asked.

A step of acceleration tilts a vehicle faster than its attitude loop follows; after it the vehicle
swings. An acceleration that is not the slope of the velocity moves it off its path.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import sqrt
from typing import Any

import pytest
from part_bench import DT, SITE, estimate, tick

from kybflow.core.events import Emitting
from kybflow.core.geometry import ZERO, Vec3, add, distance, norm, scale, sub
from kybflow.core.signals import Alarm, Retune, Setpoint, SetpointKind
from kybflow.flight.governor import LAGS
from kybflow.flight.motion import Straight
from kybflow.parts.catalog import PartSpec, load_catalog
from kybflow.world.shapes import Cylinder

CATALOG = load_catalog()
CONTEXT = SITE._replace(obstacles={"pillar": Cylinder((1.0, 0.15, 0.0), 0.2, 2.5)})
STRONGEST = 3.0 * sqrt(2.0)
"""The largest acceleration that a processor gives by default along two axes, m/s^2."""
JERK = 2.0 * STRONGEST * sqrt(CONTEXT.airframe.attitude_loop.proportional) / LAGS
TIGHTER: dict[str, dict[str, Any]] = {
    "limit_speed": {"speed": 0.4},
    "limit_acceleration": {"acceleration": 0.3},
    "fence": {"margin": 0.5},
    "obstacle_guard": {"keep": 0.3},
    "avoid_obstacles": {"keep": 0.4},
}
"""A change of each option that a person tightens in flight."""
LEG = Straight((-0.5, 0.0, 1.0), (4.0, 0.0, 1.0), 0.8, 0.7)
"""A line through the pillar to a point beyond the fence."""


def legs(kind: SetpointKind) -> Iterator[Setpoint]:
    for i in range(2500):
        motion = LEG.at(i * DT)
        places = kind is SetpointKind.POSITION
        yield Setpoint(kind, motion.position if places else None, *motion[1:], 0.0)


def jumps(kind: SetpointKind) -> Iterator[Setpoint]:
    """From inside into the pillar, on to beyond the fence, and back, without any velocity; or to
    and from velocities as large."""
    places = kind is SetpointKind.POSITION
    for place in (
        (-0.5, 0.0, 1.0), (1.0, 0.0, 1.0), (2.0, -1.0, 1.2), (3.2, -1.5, 1.0), (2.0, -1.0, 1.0),
    ):  # fmt: skip
        for _ in range(800):
            yield Setpoint(
                kind, place if places else None, ZERO if places else place, ZERO, ZERO, 0.0
            )


def flown(
    spec: PartSpec, asked: Iterator[Setpoint], tightened: dict[str, Any]
) -> list[tuple[Setpoint, bool]]:
    """Each setpoint of a vehicle that follows at once, and whether the processor bent it."""
    part = spec.cls(spec.params(), CONTEXT)
    place: Vec3 = (-0.5, 0.0, 1.0)
    last: Setpoint | None = None
    found = []
    for i, setpoint in enumerate(asked):
        if i == 600:
            part.params = replace(part.params, **tightened)
        known = estimate(place, (last and last.velocity) or ZERO)
        output = part(setpoint, tick((i + 1) * DT, known, last))
        if isinstance(output, Emitting | Retune):
            output = output.output
        if isinstance(output, Alarm):
            break
        assert isinstance(output, Setpoint)
        found.append((output, output is not setpoint))
        place = output.position or add(place, scale(output.velocity or ZERO, DT))
        last = output
    return found


@pytest.mark.parametrize("name", CATALOG.names("processors"))
@pytest.mark.parametrize("kind", [SetpointKind.POSITION, SetpointKind.VELOCITY])
@pytest.mark.parametrize("path", [legs, jumps])
def test_what_it_puts_out_is_smooth(name: str, kind: SetpointKind, path: Any) -> None:
    spec = CATALOG.get("processors", name)
    if kind not in spec.cls.accepts:
        pytest.skip(f"{name} takes no setpoints of {kind.value}")
    samples = flown(spec, path(kind), TIGHTER.get(name, {}))
    steps = [0.0]
    for (before, _), (after, is_bent) in pairwise(samples):
        a, b = before.acceleration or ZERO, after.acceleration or ZERO
        steps.append(distance(a, b))
        if not is_bent:
            continue
        changed = sub(after.velocity or ZERO, before.velocity or ZERO)
        assert norm(sub(changed, scale(add(a, b), 0.5 * DT))) < 0.02 * STRONGEST * DT + 2e-3
        if after.jerk is not None and before.jerk is not None:
            turned = scale(add(before.jerk, after.jerk), 0.5 * DT)
            stepped = 0.5 * distance(before.jerk, after.jerk) * DT
            assert norm(sub(sub(b, a), turned)) < stepped + 0.02
    assert max(steps) < JERK * DT + 0.02
