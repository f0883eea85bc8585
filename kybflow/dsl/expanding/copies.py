"""Expand a vehicle with `count` to several: `drones: {count: 3, ...}` becomes `drones1`, `drones2`
and `drones3`, which differ only in their starts, and the group `drones`, also inside other groups.

Neither `count` nor `starts` is inherited through `like`.
"""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from math import cos, pi, sin

from kybflow.core.geometry import Vec3, add, scale, sub
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.expanding.world import only_kind
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.records import layout_of
from kybflow.dsl.plan import Starts, VehiclePlan
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
    is_null,
)
from kybflow.dsl.reading.values import decode_value

CODES = {
    "KYB163": "A vehicle with `count` can't be made: it has no places to start, other numbers of "
    "vehicles and of places, or names that are taken.",
}
_KEYS = ("count", "starts")
_COUNT = layout_of(VehiclePlan).own["count"]
_KINDS = ("line", "grid", "circle", "points")
_LAYOUT = "`starts: {line: {from: [-1, 0, 0], to: [1, 0, 0]}}`"


def with_copies(root: Mapping, decoder: Decoder) -> Mapping:
    """Return the mission with all vehicles of each entry that has `count`, and their groups; report
    entries with errors, which are left out."""
    written = entries_of(root.get("vehicles"))
    several = {n: e for n, e in written.items() if any(k in entries_of(e.value) for k in _KEYS)}
    if not several:
        return root
    vehicles: dict[str, MappingEntry] = {}
    groups: dict[str, MappingEntry] = {}
    for name, entry in written.items():
        own = {name: entry}
        if name in several:
            assert isinstance(entry.value, Mapping)
            made = _copies(entry.key, entry.value, decoder)
            if made is not None:
                groups[name] = _group(entry.key, made)
            own = made or {name: entry._replace(value=_plain(entry.value))}
        for copy, one in own.items():
            if copy in (vehicles.keys() | written.keys()) - {name}:
                taken = (written.get(copy) or vehicles[copy]).key.span
                message = f"`{copy}` is the name of two vehicles"
                notes, hint = (f"the other is at {taken.at}",), f"rename `{name}`, or the other"
                decoder.found.report("KYB163", message, entry.key.span, notes=notes, help=hint)
            vehicles[copy] = one
    own_groups = root.entries.get("groups")
    for name, entry in entries_of(own_groups and own_groups.value).items():
        if name in groups:
            message = f"`{name}` is already the group of the vehicles that `{name}` makes"
            hint = "give the group another name, or remove it"
            decoder.found.report("KYB163", message, entry.key.span, help=hint)
        else:
            groups[name] = entry._replace(value=_members(entry.value, groups, several))
    head = root.entries["vehicles"]
    key = own_groups.key if own_groups is not None else head.key._replace(text="groups")
    changed = {
        "vehicles": head._replace(value=Mapping(vehicles, head.value.span)),
        "groups": MappingEntry(key, Mapping(groups, key.span)),
    }
    return Mapping({**root.entries, **changed}, root.span)


def _plain(body: Mapping) -> Mapping:
    """Return a vehicle without the keys of copies."""
    return Mapping({k: e for k, e in body.entries.items() if k not in _KEYS}, body.span)


def _copies(name: Scalar, body: Mapping, decoder: Decoder) -> dict[str, MappingEntry] | None:
    """Return the copies of a vehicle; None if it is one vehicle, or has errors, which are
    reported."""
    found, before = decoder.found, len(decoder.found.all)
    count, starts = (_own(body, key) for key in _KEYS)
    if count is None and starts is None:
        return None
    number = None if count is None else decode_value(count.value, _COUNT, found)
    if starts is None:
        if number is not None:
            message = f"`{name.text}` has a `count`, but its vehicles have no places to start"
            hint = f"write where they stand, like {_LAYOUT}"
            found.report("KYB163", message, body.entries["count"].value.span, help=hint)
        return None
    inside = {k: e for k, e in entries_of(starts.value).items() if not e.inherited}
    starts = starts._replace(value=Mapping(inside, starts.value.span))
    if only_kind(starts, _KINDS, "KYB163", "`{}` of the vehicles are", "nothing", found) is None:
        return None
    layout: Starts | None = decoder.record(Starts, starts.value, starts.key.span)
    places = None
    if layout is not None and len(found.all) == before:
        places = _places(name.text, number, starts, layout, found)
    start = body.get("start")
    at = _own(start, "at") if isinstance(start, Mapping) else None
    if at is not None and not body.entries["start"].inherited:
        message = f"`{name.text}` has `starts`, so each of its vehicles starts elsewhere"
        found.report("KYB163", message, at.key.span, help="remove `at`; `heading` is that of all")
    if places is None:
        return None
    span = next(entry.value.span for entry in inside.values())
    key = starts.key._replace(text="start")
    made: dict[str, MappingEntry] = {}
    for i, place in enumerate(places, start=1):
        node = Sequence(tuple(Scalar(repr(round(x, 6) + 0.0), span) for x in place), span)
        own = {**entries_of(start), "at": MappingEntry(key._replace(text="at"), node)}
        entries = {**_plain(body).entries, "start": MappingEntry(key, Mapping(own, span))}
        copy = name._replace(text=f"{name.text}{i}")
        made[copy.text] = MappingEntry(copy, Mapping(entries, body.span))
    return made


def _own(body: Mapping, key: str) -> MappingEntry | None:
    """Return a key that is neither null nor inherited."""
    entry = body.entries.get(key)
    return None if entry is None or entry.inherited or is_null(entry.value) else entry


def _places(
    name: str, number: int | None, starts: MappingEntry, layout: Starts, found: Collector
) -> list[Vec3] | None:
    """Return the positions at which the vehicles start; None without their right number, which is
    reported."""
    if layout.points is not None:
        if number in (None, len(layout.points)):
            return list(layout.points)
        message = f"`{name}` has a `count` of {number}, but {len(layout.points)} places to start"
        hint = "leave out `count`: it is the number of `points`"
        found.report("KYB163", message, layout.span_of("points"), help=hint)
    elif number is None:
        message, hint = f"`{name}` has `starts`, but no `count`", "write how many there are"
        found.report("KYB163", message, starts.key.span, help=f"{hint}: `count: 6`")
    elif (line := layout.line) is not None:
        step = scale(sub(line.end, line.begin), 1.0 / max(number - 1, 1))
        return [add(line.begin, scale(step, float(i))) for i in range(number)]
    elif (grid := layout.grid) is not None:
        cells, apart = (divmod(i, grid.columns) for i in range(number)), grid.spacing
        return [add(grid.at, (column * apart, row * apart, 0.0)) for row, column in cells]
    elif (circle := layout.circle) is not None:
        angles = (2.0 * pi * i / number for i in range(number))
        return [add(circle.at, scale((cos(a), sin(a), 0.0), circle.radius)) for a in angles]
    return None


def _group(name: Scalar, made: MappingOf[str, MappingEntry]) -> MappingEntry:
    members = tuple(Scalar(copy, name.span) for copy in made)
    return MappingEntry(name, Sequence(members, name.span))


def _members(
    node: Node, made: MappingOf[str, MappingEntry], several: MappingOf[str, MappingEntry]
) -> Node:
    """Return a list of vehicles, with the vehicles of an entry in place of its name."""
    if not isinstance(node, Sequence):
        return node
    items: list[Node] = []
    for item in node.items:
        group = made.get(item.text) if isinstance(item, Scalar) and item.text in several else None
        copies = group.value.items if group and isinstance(group.value, Sequence) else (item,)
        items += (one._replace(span=item.span) for one in copies)
    return Sequence(tuple(items), node.span)
