"""Expand the resolved tree of a mission to its plan as written, and check a library without a
mission.

Every value of the plan is in SI and every part has its parameters; names are not resolved yet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kybflow.core.params import fields_of
from kybflow.dsl.diagnostics import PREFIX, Findings, Span
from kybflow.dsl.expanding.callbacks import callbacks_of, faults_of
from kybflow.dsl.expanding.flows import flows_of, with_requests, with_waiting
from kybflow.dsl.expanding.targets import Target, inputs_of, needed_rate
from kybflow.dsl.expanding.vehicles import body_of, vehicle_of
from kybflow.dsl.expanding.world import with_coordinates, with_points, world_of
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.plan import LISTS, Body, EstimatorPlan, Plan, StatePlan
from kybflow.dsl.reading.nodes import Mapping, Scalar, entries_of, items_of, scalars_in
from kybflow.dsl.reading.values import decode_value
from kybflow.dsl.resolving.exports import EMPTY, chain_of, stack_of
from kybflow.dsl.resolving.resolve import Resolved

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CODES = {
    "KYB152": "A control rate that is no whole number of Hz, or too low or too high to fly with.",
}
LEAST_CONTROL, MOST_CONTROL = 25, 1000
_LEFT_TO_LIKE = frozenset({"KYB108", "KYB385"})


def mission_of(
    resolved: Resolved, catalog: Catalog, target: str | None, found: Findings
) -> Plan | None:
    """Return the plan as written, or None if it has errors."""
    root, decoder = resolved.root, Decoder(catalog, found, resolved.chains)
    world = world_of(root.get("world"), decoder)
    if resolved.names_points:
        root = with_points(root, world.points, found)
    chosen = Target(root, target, decoder)
    drivers = chosen.drivers()
    chosen.judge_others()
    entries = entries_of(root.get("vehicles")).items()
    written = [vehicle_of(entry, drivers.get(name), decoder) for name, entry in entries]
    whole = [vehicle for vehicle in written if vehicle is not None]
    vehicles = tuple(chosen.equipped(whole))
    plan: Plan | None = decoder.record(
        Plan, root, root.span, imports={}, parameters={}, chains={}, stacks={},
        airframes=airframes_of(root, decoder), world=world, vehicles=vehicles,
        inputs=inputs_of(root, chosen.name.text, decoder),
        flows=flows_of(root.get("flows"), decoder),
        callbacks=callbacks_of(root.get("on"), decoder),
        faults=faults_of(root.get("faults"), decoder), targets={}, target=chosen.name.text,
        simulated=all(vehicle.driver.cls.simulated for vehicle in vehicles),
        control_rate=_control(root, needed_rate(v.driver for v in vehicles), decoder),
        fence=world.box, expectations=(), sources=(), resolved="",
        obstacles={o.name: o.shape for o in world.obstacles if o.shape is not None},
        moving={o.name: o.moving for o in world.obstacles if o.moving is not None},
        touchable=frozenset(o.name for o in world.obstacles if o.may_touch),
        points=world.points, target_text=chosen.name,
        values=with_coordinates(resolved.parameters, world.points),
    )  # fmt: skip
    if plan is None or found.has_errors:
        return None
    return with_requests(with_waiting(plan))


def _control(root: Mapping, needed: int, decoder: Decoder) -> int:
    """Return the control rate, Hz: the one written, or else `needed`."""
    node = root.get("control")
    if not isinstance(node, Scalar):
        return needed
    field = next(f for f in fields_of(Plan) if f.name == "control")
    rate = decode_value(node, field, Findings())
    if rate is None:
        return needed
    if not rate.is_integer():
        message = f"`control` must be a whole number of Hz, but this is {rate:g} Hz"
        decoder.found.report("KYB152", message, node.span, help=f"write `{rate:.0f} Hz`")
    elif not LEAST_CONTROL <= rate <= MOST_CONTROL:
        message = f"`control` can't be {node.text}"
        why = "no tracker holds a vehicle at such a low rate" if rate < LEAST_CONTROL else ""
        hint = f"write {LEAST_CONTROL} to {MOST_CONTROL} Hz"
        decoder.found.report("KYB152", message, node.span, why, help=hint)
    return int(rate)


def airframes_of(root: Mapping, decoder: Decoder) -> tuple[Body, ...]:
    """Return the airframes that the file itself describes. An incomplete airframe is not reported,
    because others may start from it."""
    airframes: list[Body] = []
    for name, entry in entries_of(root.get("airframes")).items():
        assert isinstance(entry.value, Mapping)
        found = Findings()
        own = body_of(name, entry.key.span, entry.value, Decoder(decoder.catalog, found))
        decoder.found.add(finding for finding in found.all if finding.code not in _LEFT_TO_LIKE)
        if own is not None:
            airframes.append(own)
    return tuple(airframes)


_LEFT_TO_MISSION = frozenset({"KYB102", "KYB108"})


def judge_library(library: Mapping, catalog: Catalog, found: Findings) -> None:
    """Report errors in the worlds, airframes, parts and flows of a library.

    `like` is already resolved, except in chains. What the importing mission can provide is not
    reported: a parameter without a value, a named point, and a missing key of an entry to start
    from.
    """
    decoder = Decoder(catalog, found)
    for entry in entries_of(library.get("worlds")).values():
        world_of(entry.value, decoder)
    airframes_of(library, decoder)
    left, own = set[Span](), Findings()
    decoder = Decoder(catalog, own)
    for section in ("vehicles", "stacks", "chains"):
        for entry in entries_of(library.get(section)).values():
            if isinstance(entry.value, Mapping):
                _judge_parts(entry.value, decoder)
    flows_of(library.get("flows"), decoder)
    for section in ("vehicles", "stacks", "chains", "flows"):
        inside = scalars_in(library.get(section) or EMPTY)
        left.update(s.span for s in inside if "$" in s.text or s.text.startswith(PREFIX))
    found.add(f for f in own.all if f.code not in _LEFT_TO_MISSION and f.span not in left)


def _judge_parts(body: Mapping, decoder: Decoder) -> None:
    for kind in LISTS:
        for item in items_of(body.get(kind)):
            if stack_of(item) is not None:
                continue
            if kind == "estimators":
                decoder.record(EstimatorPlan, item, item.span)
            else:
                decoder.part(kind, item)
    tracker = body.get("tracker")
    if tracker is not None:
        decoder.part("trackers", tracker)
    for name, entry in entries_of(body.get("behaviors")).items():
        if isinstance(entry.value, Mapping) and chain_of(entry.value) is None:
            decoder.record(
                StatePlan, entry.value, entry.key.span, name=name, legs=(), transitions=()
            )
