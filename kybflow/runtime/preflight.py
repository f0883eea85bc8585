"""The preflight: no vehicle arms before every line is green.

Each line names a check, its finding and the mission line that it concerns. If a supervisor would
interrupt the mission as soon as the vehicle flew, the vehicle stays on the ground.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import degrees
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance, heading_of, wrap
from kybflow.core.params import named_in
from kybflow.core.signals import Estimate, Imu, Pose, Position, kind_name
from kybflow.core.units import DEG
from kybflow.dsl.plan import InputPlan, Plan
from kybflow.parts.events import PreflightWaits
from kybflow.runtime.clock import TickCount
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.knowledge import REST_TIME_S
from kybflow.runtime.vehicle.touch_down import START_TOLERANCE, allowed_distance, said_distance
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.objects import distance_to, place_of
from kybflow.world.shapes import Box, Shape, Sphere

RED_TIMEOUT_S = 5.0
"""Seconds for which the preflight waits for red lines once the vehicles are ready."""
LINK_AGE_S = 1.0
"""Largest age (s) of the link's last measurement."""
MIN_RATE_HZ = 4.0
"""Lowest acceptable rate (Hz) of an estimator's measurements. The slowest stream in use has 5 Hz,
and its rate appears lower between two measurements."""
LEAST_TICKS = 0.5
"""The share of the ticks that the computer must make while the vehicles stand."""
MOST_TURNED, MOST_SLANT = 35.0 * DEG, 15.0 * DEG
"""Largest angles of an estimate's heading from the declared one, and of the vertical by motion
capture from that by the accelerometer, rad."""
MOST_SHAKE = 0.15
"""Largest second difference of poses at rest, m: that of a noise of 4 cm."""
_HOVER_HEIGHT = 0.3
"""Metres above the vehicle at which its distance from obstacles is checked."""

_FLOOR_DEPTH = 100.0
"""Metres by which the preflight lowers the fence's floor, because the vehicle is on the ground."""


class PreflightResult(NamedTuple):
    """One check of a vehicle.

    green: whether the check passed.
    at: the mission line that it concerns.
    waits: True while the vehicle is still getting ready by itself, False if only a person can fix
    the cause, None if unknown.
    """

    vehicle: str
    check: str
    green: bool
    reason: str
    at: str = ""
    waits: bool | None = None


def preflight(vehicle: Vehicle, others: Sequence[Vehicle]) -> Iterator[PreflightResult]:
    """Yield the preflight's lines for a vehicle. others: all vehicles of the mission."""
    name, at = vehicle.name, vehicle.plan.driver.at
    if vehicle.link_error is not None:
        yield PreflightResult(name, "link", False, vehicle.link_error, at)
        return
    age, battery = vehicle.link_age, vehicle.battery
    delivers = vehicle.knowledge.link_in.has_delivered
    reason = f"delivered {age * 1000:.0f} ms ago" if delivers else "no measurement has arrived yet"
    yield PreflightResult(name, "link", delivers and age <= LINK_AGE_S, reason, at)
    yield from _own(vehicle)
    yield from _streams(vehicle)
    reason = "no report" if battery is None else f"{battery.remaining:.0%}"
    yield PreflightResult(name, "battery", battery is not None, reason, at)
    estimate, parts = vehicle.estimate, [e.part for e in vehicle.plan.estimators]
    if Pose in vehicle.knowledge.needs:
        yield _frame(vehicle, parts[0].at)
    elif Position in vehicle.knowledge.needs:
        reason = "not judged: positions without an attitude are not compared with the IMU"
        yield PreflightResult(name, "frame", True, reason, parts[0].at)
    if estimate is None:
        reason = f"no healthy estimate from {', '.join(part.name for part in parts)}"
        if vehicle.knowledge.cameras.is_blind:
            reason += ": frames arrive, but no tag of the map is found in them"
        yield PreflightResult(name, "estimate", False, reason, parts[0].at)
        return
    reason = f"{estimate.source}, spread {estimate.spread * 1000:.1f} mm"
    yield PreflightResult(name, "estimate", True, reason, parts[0].at)
    yield _start(vehicle, estimate, others)
    yield _heading(vehicle, estimate)
    yield from _surroundings(vehicle, estimate.position)
    for label, why, line in vehicle.foreseen({other.name: other.estimate for other in others}):
        yield PreflightResult(name, label, False, why, line)


def input_lines(
    plan: Plan, objections: Iterable[tuple[InputPlan, str | None]]
) -> Iterator[PreflightResult]:
    """Yield a line for each input, attributed to the first vehicle that the input steers."""
    for own, reason in objections:
        steered = (
            v.name
            for v in plan.vehicles
            for state in v.states.values()
            if own.name in named_in(state.behavior.params, "input").values()
        )
        vehicle, well = next(steered, plan.vehicles[0].name), "it works"
        yield PreflightResult(vehicle, f"input {own.name}", reason is None, reason or well, own.at)


def clock_lines(plan: Plan, ticks: TickCount) -> Iterator[PreflightResult]:
    """Yield a line about the ticks that the computer made in the last second of the preflight,
    attributed to the first vehicle. Simulated time is never late."""
    if plan.simulated:
        return
    green, waits, reason = ticks.share >= LEAST_TICKS, None, str(ticks)
    if not ticks.due:
        green, waits, reason = False, True, "its ticks are being counted for one second"
    elif not green:
        reason += ": end other programs, or declare a lower rate as `control`"
    yield PreflightResult(plan.vehicles[0].name, "computer", green, reason, waits=waits)


def body_lines(
    plan: Plan, what: str, objections: Iterable[tuple[str, str | None]]
) -> Iterator[PreflightResult]:
    """Yield a line for each body that motion capture tracks besides the vehicles, attributed to the
    first vehicle of the mission. what: `obstacle` or `object`."""
    for name, reason in objections:
        at = plan.watching[name][1].at if name in plan.watching else ""
        vehicle = plan.vehicles[0].name
        yield PreflightResult(vehicle, f"{what} {name}", reason is None, reason or "it is seen", at)


def _own(vehicle: Vehicle) -> Iterator[PreflightResult]:
    """Yield the vehicle's own checks. If the vehicle doesn't report on its watchdog, its driver
    class does."""
    checks, driver = vehicle.knowledge.link_in.checks(vehicle.now), vehicle.plan.driver
    if all(check.name != "watchdog" for check in checks):
        danger = driver.cls.watchdog(driver.params)
        reason = danger or "it lands by itself when commands stop"
        yield PreflightResult(vehicle.name, "watchdog", danger is None, reason, driver.at)
    for name, green, reason, waits in checks:
        waiting = None if green else waits
        yield PreflightResult(vehicle.name, name, green, reason, driver.at, waiting)


def _streams(vehicle: Vehicle) -> Iterator[PreflightResult]:
    """Check the rate of every kind of measurement that an estimator uses."""
    knowledge = vehicle.knowledge
    parts = [estimator.part for estimator in vehicle.plan.estimators]
    at = {kind: part.at for part in parts for kind in part.cls.uses(part.params)}
    for kind in sorted(knowledge.needs, key=kind_name):
        rate = knowledge.rate(kind)
        reason = f"{rate:.0f} Hz" if rate else "no measurements"
        green = rate >= MIN_RATE_HZ
        if rate and not green:
            reason += f", {MIN_RATE_HZ:.0f} Hz needed"
        if green and kind is Imu and not knowledge.resting.is_known:
            green, reason = False, f"{reason}, not yet {REST_TIME_S} s at rest"
        trouble, refused = knowledge.sensing.trouble(kind), knowledge.sensing.refused(kind)
        if trouble is not None:
            green, reason = False, f"{reason}: {trouble}"
        if refused and not green:
            reason = f"{reason}; {refused} were left out as implausible"
        yield PreflightResult(vehicle.name, f"{kind_name(kind)} stream", green, reason, at[kind])


def _start(vehicle: Vehicle, estimate: Estimate, others: Sequence[Vehicle]) -> PreflightResult:
    """Check that the vehicle is at its declared start. If it is where another vehicle should
    start, their motion capture bodies are probably swapped, and the reason says so."""
    away = distance(estimate.position, vehicle.context.start)
    green = away <= allowed_distance(estimate)
    reason = f"{away:.2f} m from the declared start ({said_distance(estimate)})"
    for other in others if not green else ():
        there = distance(estimate.position, other.context.start) <= START_TOLERANCE
        if there and other is not vehicle:
            reason += f"; the body of `{vehicle.name}` stands where `{other.name}` should start"
    return PreflightResult(vehicle.name, "start pose", green, reason, vehicle.plan.at)


def _heading(vehicle: Vehicle, estimate: Estimate) -> PreflightResult:
    """Check that the vehicle has its declared heading. If it hasn't, it may be its body in motion
    capture that is turned."""
    declared, found = vehicle.context.heading, heading_of(estimate.attitude)
    off = abs(wrap(found - declared))
    most = degrees(MOST_TURNED)
    reason = f"{degrees(off):.0f} deg from the declared heading ({most:.0f} deg allowed)"
    green = off <= MOST_TURNED
    if not green:
        reason += (
            f": turn the vehicle, redefine its body with the x axis along the nose, or write"
            f" `heading: {degrees(found):.0f} deg` in `start`"
        )
    return PreflightResult(vehicle.name, "heading", green, reason, vehicle.plan.at)


def _frame(vehicle: Vehicle, at: str) -> PreflightResult:
    """Check the poses of motion capture against gravity, and that they rest with the vehicle."""
    frame, name = vehicle.knowledge.frame, vehicle.name
    slant, most = frame.slant, degrees(MOST_SLANT)
    if frame.shake > MOST_SHAKE:
        reason = f"its poses at rest vary by {frame.shake:.2f} m: check the stream's `units`"
        return PreflightResult(name, "frame", False, reason, at)
    if slant is None:
        reason = "not checked: `units` and `axes` of the stream need an IMU"
        return PreflightResult(name, "frame", True, reason, at)
    green = slant <= MOST_SLANT
    reason = f"{degrees(slant):.0f} deg off gravity ({most:.0f} deg allowed)"
    if not green:
        reason += ": redefine the vehicle's body while it stands level, or check the `axes`"
    elif not frame.is_judged:
        reason += "; the IMU is too slow to check `units` and `axes` in flight"
    return PreflightResult(name, "frame", green, reason, at)


def _surroundings(vehicle: Vehicle, position: Vec3) -> Iterator[PreflightResult]:
    context = vehicle.context
    x, y, z = position
    if context.fence is not None:
        west, south, floor = context.fence.low
        walls = Box((west, south, min(floor, z) - _FLOOR_DEPTH), context.fence.high)
        outside = walls.outside_by(position)
        reason = f"{outside:.2f} m outside" if outside > 0.0 else f"{-outside:.2f} m inside"
        yield PreflightResult(vehicle.name, "fence", outside <= 0.0, reason, vehicle.plan.at)
    balls = {name: Sphere(seen.position, seen.radius) for name, seen in vehicle.moving.items()}
    solids: dict[str, Shape] = {**context.obstacles, **balls}
    above, objects = (x, y, z + _HOVER_HEIGHT), context.objects
    rooms = {name: solid.distance(above) for name, solid in solids.items()}
    for name, one in objects.items():
        rooms[name] = distance_to(one, place_of(objects, vehicle.objects, name), above)
    if rooms:
        room, name = min((room, name) for name, room in rooms.items())
        reason = f"{room:.2f} m from `{name}` ({context.airframe.arm:.2f} m needed)"
        green = room >= context.airframe.arm
        yield PreflightResult(vehicle.name, "obstacles", green, reason, vehicle.plan.at)


class PreflightTimeout:
    """Decides how long the preflight waits for red lines.

    The preflight times out `RED_TIMEOUT_S` after the vehicles are ready. They may take up
    to the longest `preflight_timeout` of their drivers to get ready: an autopilot's filter settles,
    a receiver finds its satellites. If a line is red that only a person can fix, the preflight
    times out `RED_TIMEOUT_S` after its start. Each cause of waiting is reported once."""

    def __init__(self, plan: Plan, events: Events) -> None:
        longest: list[float] = [vehicle.driver.cls.preflight_timeout for vehicle in plan.vehicles]
        self._longest = max(RED_TIMEOUT_S, *longest)
        self._events = events
        self._ready = 0.0
        self._reported: set[tuple[str, str]] = set()

    def ends(self, lines: Sequence[PreflightResult], seconds: float) -> bool:
        """Return whether the preflight is over: all lines are green, or it has timed out."""
        if all(line.green for line in lines):
            return True
        waiting = [line for line in lines if line.waits]
        if waiting:
            self._ready = seconds
        hopeless = any(line.waits is False and not line.green for line in lines)
        bound = RED_TIMEOUT_S if hopeless else self._ready + RED_TIMEOUT_S
        late: bool = seconds >= min(bound, self._longest)
        if seconds >= RED_TIMEOUT_S and not late:
            for vehicle, check, _, reason, at, _ in waiting:
                if (vehicle, check) not in self._reported:
                    self._reported.add((vehicle, check))
                    self._events.emit(PreflightWaits(check=check, reason=reason), vehicle, at)
        return late
