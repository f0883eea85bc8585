"""Expand the resolved tree of a mission to its plan as written, with its callbacks and faults, and
check a library without a mission.

Every value of the plan is in SI and every part has its parameters; names are not resolved yet.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from kybflow.core.params import fields_of
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import PREFIX, Collector, Span
from kybflow.dsl.expanding.copies import with_copies
from kybflow.dsl.expanding.flows import flows_of, with_requests, with_waiting
from kybflow.dsl.expanding.targets import Target, inputs_of, needed_rate
from kybflow.dsl.expanding.vehicles import body_of, vehicle_of
from kybflow.dsl.expanding.world import with_coordinates, with_points, world_of
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.records import EMPTY, Source
from kybflow.dsl.plan import (
    LISTS,
    ActionKeys,
    Body,
    CallbackPlan,
    EstimatorPlan,
    FaultPlan,
    PartPlan,
    Plan,
    StatePlan,
)
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    describe,
    entries_of,
    head_of,
    is_null,
    items_of,
    scalars_in,
)
from kybflow.dsl.reading.values import decode_value
from kybflow.dsl.resolving.exports import chain_of, stack_of
from kybflow.dsl.resolving.resolve import Resolved
from kybflow.parts.action import BUILT_IN
from kybflow.world.objects import standing

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CODES = {
    "KYB152": "The control rate is not a whole number of Hz, or is too low or too high.",
    "KYB170": "An action is unknown to the language and to the installed packages.",
    "KYB171": "A callback does nothing, or an action is not one key with a value.",
    "KYB461": "A callback has neither an event nor a condition, or a key that needs the other one.",
    "KYB180": "A fault has neither a time nor a condition, or both.",
}
LEAST_CONTROL, MOST_CONTROL = 25, 1000
_LEFT_TO_LIKE = frozenset({"KYB108", "KYB385"})
_LEFT_TO_MISSION = frozenset({"KYB102", "KYB108"})
_CALLBACK_KEYS = frozenset(field.key for field in fields_of(CallbackPlan))


def mission_of(
    resolved: Resolved, catalog: Catalog, target: str | None, found: Collector
) -> Plan | None:
    """Return the plan as written, or None if it has errors."""
    root, decoder = resolved.root, Decoder(catalog, found, resolved.chains)
    world = world_of(root.get("world"), decoder)
    if resolved.names_points:
        root = with_points(root, world.points, found)
    root = with_copies(root, decoder)
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
        moving={o.name: ball for o in world.obstacles if (ball := o.moving_sphere) is not None},
        objects=standing(o.made for o in world.objects),
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
    rate = decode_value(node, field, Collector())
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
        found = Collector()
        own = body_of(name, entry.key.span, entry.value, Decoder(decoder.catalog, found))
        decoder.found.add(finding for finding in found.all if finding.code not in _LEFT_TO_LIKE)
        if own is not None:
            airframes.append(own)
    return tuple(airframes)


def judge_library(library: Mapping, catalog: Catalog, found: Collector) -> None:
    """Report errors in the worlds, airframes, parts and flows of a library.

    `like` is already resolved, except in chains. What the importing mission can provide is not
    reported: a parameter without a value, a named point, and a missing key of an entry to start
    from.
    """
    decoder = Decoder(catalog, found)
    for entry in entries_of(library.get("worlds")).values():
        world_of(entry.value, decoder)
    airframes_of(library, decoder)
    left, own = set[Span](), Collector()
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


def callbacks_of(node: Node | None, decoder: Decoder) -> tuple[CallbackPlan, ...]:
    """Return the callbacks of `on:`, without those that have errors."""
    callbacks = (_callback(item, decoder) for item in items_of(node) if isinstance(item, Mapping))
    return tuple(filter(None, callbacks))


def _callback(node: Mapping, decoder: Decoder) -> CallbackPlan | None:
    event, items, found = node.get("event"), items_of(node.get("do")), decoder.found
    asked = [
        entry
        for key, entry in node.entries.items()
        if key not in _CALLBACK_KEYS and not is_null(entry.value)
    ]
    if event is not None and node.get("for") is not None:
        hint = "`for` belongs to a `when` without an `event`"
        span = node.entries["for"].key.span
        found.report("KYB461", "an event has no duration", span, help=hint)
    elif event is None and node.get("when") is None:
        hint = "write `event: NAME`, `when: CONDITION`, or both"
        message = "the callback has neither `event` nor `when`"
        found.report("KYB461", message, head_of(node), help=hint)
    for entry in asked if event is None else ():
        message = f"`{entry.key.text}` is a field of an event, but there is no `event`"
        hint = "add `event: NAME`, or test it in the `when`"
        found.report("KYB461", message, entry.key.span, help=hint)
    if not items:
        what = f"callback of `{event.text}`" if isinstance(event, Scalar) else "callback"
        message = f"the {what} has no action"
        found.report("KYB171", message, head_of(node), help="write `do: [...]`")
    for entry in asked:
        decoder.misplaced(entry.value, entry.key.text)
    fields = tuple((e.key.text, e.value.text) for e in asked if isinstance(e.value, Scalar))
    actions = tuple(action for item in items for action in _actions(item, decoder))
    own: dict[str, Any] = {"event": ""} if event is None else {}
    callback: CallbackPlan | None = decoder.record(
        CallbackPlan, node, node.span, fields=fields, do=actions, vehicles=(), actions=(), **own
    )
    return callback


def _actions(node: Node, decoder: Decoder) -> Iterator[ActionKeys]:
    """Yield the actions of one item; `switch`, `set` and `perform` may have several targets."""
    found = decoder.found
    if not isinstance(node, Mapping) or len(node.entries) != 1:
        hint = "write each as an item of its own: `do: [{log: hello}, {emit: ready}]`"
        found.report("KYB171", "an action is one key with its value", head_of(node), help=hint)
        return
    [entry] = node.entries.values()
    name, value = entry.key.text, entry.value
    source = Source(entry.key.span, node)
    if name not in BUILT_IN:
        part = _part(entry, decoder)
        if part is not None:
            yield ActionKeys(name=name, part=part, source=source)
    elif isinstance(value, Mapping):
        yield from _targeted(entry, decoder)
    elif isinstance(value, Scalar) and not value.is_null:
        yield ActionKeys(name=name, value=value.text, source=source)
    elif isinstance(value, Sequence):
        decoder.misplaced(value, name)
    else:
        hint = f"write it, `{name}: ...`, or remove `{name}`"
        found.report("KYB171", f"`{name}` has no value", entry.key.span, help=hint)


def _targeted(entry: MappingEntry, decoder: Decoder) -> Iterator[ActionKeys]:
    """Yield the actions of `{set: {NAME: VALUE, ...}}`, one for each target."""
    name = entry.key.text
    for target in entries_of(entry.value).values():
        value: Any = None
        key = target.key
        if is_null(target.value):
            hint = f"write the new value, `{key.text}: ...`"
            decoder.found.report("KYB171", f"`{key.text}` has no value", key.span, help=hint)
        elif name == "set":
            value = target.value
        elif name == "switch":
            value = decoder.request(target)
        elif not decoder.misplaced(target.value, key.text) and isinstance(target.value, Scalar):
            value = target.value.text
        if value is not None:
            source = Source(key.span, Mapping({key.text: target}, key.span))
            yield ActionKeys(name=name, target=key.text, value=value, source=source)


def _part(entry: MappingEntry, decoder: Decoder) -> PartPlan | None:
    """Return an action of a package, whose value is the mapping of its parameters; None if it has
    errors."""
    name, known, found = entry.key, decoder.catalog.names("actions"), decoder.found
    if name.text not in known:
        hint = did_you_mean(name.text, (*BUILT_IN, *known))
        found.report("KYB170", f"no action is called `{name.text}`", name.span, help=hint)
        return None
    if not isinstance(entry.value, Mapping) and not is_null(entry.value):
        message = f"`{name.text}` must be a mapping, but this is {describe(entry.value)}"
        hint = f"write its parameters: `{{{name.text}: {{...}}}}`"
        found.report("KYB103", message, entry.value.span, help=hint)
        return None
    body = entry.value if isinstance(entry.value, Mapping) else Mapping({}, name.span)
    return decoder.named_part("actions", name, body, f"actions.{name.text}")


def faults_of(node: Node | None, decoder: Decoder) -> tuple[FaultPlan, ...]:
    """Return the faults of `faults:`, without those that have errors."""
    faults: list[FaultPlan] = []
    for item in (item for item in items_of(node) if isinstance(item, Mapping)):
        when, name = item.get("when"), item.get("inject")
        if (item.get("at") is None) is (when is None):
            both = when is not None
            what = f"`{name.text}`" if isinstance(name, Scalar) else "a fault"
            message = f"{what} has {'both `at` and' if both else 'neither `at` nor'} `when`"
            span = name.span if isinstance(name, Scalar) else head_of(item)
            span = item.entries["when"].key.span if both else span
            hint = "write one: `at: 20 s` or `when: CONDITION`"
            decoder.found.report("KYB180", message, span, help=hint)
        fault: FaultPlan | None = decoder.record(FaultPlan, item, item.span)
        if fault is not None:
            span = fault.part.span
            faults.append(fault.but(at=span.at, source=fault.source._replace(span=span)))
    return tuple(faults)
