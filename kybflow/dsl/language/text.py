"""Write records as YAML that is read back as the same records, exact to the last digit. The text
has no import, `like` or parameter; every default is written, and each line has its origin as a
comment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from kybflow.core.params import Field, ListOf, MappingOf, Numbers, RecordOf, ValueType, fields_of
from kybflow.core.units import ANGLE, ANGULAR_RATE, DEG, RATIO, Dimension, parse_quantity
from kybflow.dsl.diagnostics import PREFIX, Span
from kybflow.dsl.expressions.tree import Unparsed
from kybflow.dsl.language.records import EVENT_FIELD, STATE, PartOf, Record, UsesOf
from kybflow.dsl.language.schema import NAMES
from kybflow.dsl.plan import ActionKeys, PartPlan, Place, Plan, Request, SensorPlan
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, entries_of
from kybflow.dsl.resolving.library_files import without_homes
from kybflow.dsl.world import World

YamlLine = tuple[str, str]
"""A line of YAML and its origin, which is empty for a default."""
_WRITTEN = {ANGLE: (DEG, "deg"), ANGULAR_RATE: (DEG, "deg/s"), RATIO: (0.01, "%")}
_PLAIN_FIRST = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ")
_RESERVED = frozenset({"true", "false", "null", "True", "False", "Null", "yes", "no", "on", "off"})
_NOTHING: tuple[Any, ...] = (None, (), {}, "", World())


def to_yaml(plan: Plan) -> str:
    """Return the text of a plan whose names are not resolved yet, each line with its origin as a
    comment."""
    lines = [*_lines(plan, "", {"airframes": (), "control": float(plan.control_rate)})]
    lines += _target(plan)
    width = min(max(len(line) for line, _ in lines), 76)
    return "".join(
        f"{line:<{width}}  # {without_homes(came_from) or 'default'}\n" for line, came_from in lines
    )


def _lines(record: Record, indent: str, instead: dict[str, Any]) -> Iterator[YamlLine]:
    """Yield the lines of a record, one for each key. instead: values that replace those of some
    fields."""
    own: Any = record.__class__
    for field in fields_of(own):
        value = instead.get(field.name, getattr(record, field.name))
        if isinstance(field.type, RecordOf) and field.type.flat:
            for inner in fields_of(field.type.cls):
                yield from _entry(record, inner, getattr(value, inner.name), indent)
        else:
            yield from _entry(record, field, value, indent)


def _entry(record: Record, field: Field, value: Any, indent: str) -> Iterator[YamlLine]:
    kind, head, inner = field.type, f"{indent}{field.key}:", f"{indent}  "
    came_from = _place(record, field.key)
    if isinstance(kind, UsesOf) and not value:
        yield f"{head} []", came_from
    elif value in _NOTHING:
        return
    elif isinstance(kind, RecordOf) and getattr(kind.cls, "block", False):
        yield head, came_from
        yield from _lines(value, inner, {})
    elif isinstance(kind, MappingOf) and record.block:
        yield head, came_from
        for name, item in _items(value, kind):
            yield from _named(record, field, name, item, inner)
    elif isinstance(kind, UsesOf) or (isinstance(kind, ListOf) and isinstance(record, Plan)):
        yield head, came_from
        texts = record.texts_of(field.key)
        for index, item in enumerate(value):
            is_own = isinstance(item, Record) and item.span != record.span
            at = _origin(item) if is_own else ""
            at = texts[index].span.at if isinstance(item, str) else at
            yield f"{inner}- {_text(item, kind.item, field)}", at
    else:
        notes = _notes(value) if isinstance(value, Record) else ""
        yield f"{head} {_text(value, kind, field)}", came_from + notes


def _items(value: Any, kind: MappingOf) -> Iterable[tuple[str, Any]]:
    """Return the entries of a mapping of names."""
    return value.items() if kind.as_dict else ((item.name, item) for item in value)


def _named(record: Record, field: Field, name: str, item: Any, indent: str) -> Iterator[YamlLine]:
    """Yield the lines of one entry of a mapping of names."""
    assert isinstance(field.type, MappingOf)
    if isinstance(item, Record):
        if item.block:
            yield f"{indent}{name}:", item.span.at
            instead = {"tracker": own} if (own := getattr(item, "own_tracker", None)) else {}
            yield from _lines(item, f"{indent}  ", instead)
        else:
            yield f"{indent}{name}: {_flow(item)}", _origin(item)
        return
    entry = record.entry(field.key)
    own_key = entries_of(entry.value)[name].key if entry is not None else None
    came_from = "" if own_key is None else own_key.span.at
    if isinstance(record, World):
        # uses of the point are coordinates now, so the comment keeps the name of the point
        came_from = f"{came_from}, {PREFIX}{name}"
    yield f"{indent}{name}: {_text(item, field.type.item, field)}", came_from


def _target(plan: Plan) -> Iterator[YamlLine]:
    """Yield the lines of the chosen target, with the driver, tracker and sensors of each
    vehicle."""
    assert plan.target_text is not None
    name, is_written = plan.target_text, plan.target_text.span != plan.key_span("mission")
    yield "targets:", _place(plan, "targets")
    yield f"  {name.text}:", name.span.at if is_written else ""
    for vehicle in plan.vehicles:
        driver, place = vehicle.driver, vehicle.reached
        named = [use for use in vehicle.sensors if use.estimators]
        is_implied = driver.span == name.span and not is_written
        came_from = "" if is_implied else _origin(driver)
        plain = [
            line
            for field in fields_of(Place)
            if field.key not in ("driver", "tracker", "sensors")
            for line in _entry(place, field, getattr(place, field.name), "      ")
        ]
        if not named and not plain and vehicle.own_tracker is None:
            yield f"    {vehicle.name}: {{driver: {_part(driver)}}}", came_from
            continue
        yield f"    {vehicle.name}:", came_from
        yield f"      driver: {_part(driver)}", came_from
        if vehicle.own_tracker is not None:
            origin = "" if vehicle.tracker.span == driver.span else _origin(vehicle.tracker)
            yield f"      tracker: {_part(vehicle.tracker)}", origin
        yield from plain
        if named:
            yield "      sensors:", named[0].span.at
        for estimator in dict.fromkeys(use.estimators[0] for use in named):
            yield from _sensors([use for use in named if use.estimators[0] == estimator])


def _sensors(uses: list[SensorPlan]) -> Iterator[YamlLine]:
    """Yield the lines of the sensors of one estimator, as a list if there are several."""
    name = uses[0].estimators[0]
    if len(uses) == 1:
        yield f"        {name}: {_part(uses[0].part)}", _origin(uses[0].part)
        return
    yield f"        {name}:", uses[0].span.at
    for use in uses:
        yield f"          - {_part(use.part)}", _origin(use.part)


def _place(record: Record, key: str) -> str:
    """Return the location of a key, and of the value that replaced a `$name` there."""
    entry = record.entry(key)
    return "" if entry is None else entry.key.span.at + _given("", entry.value.span)


def _origin(record: Record) -> str:
    """Return the location of a record, and of each value that replaced a `$name` in it."""
    own = record if isinstance(record, PartPlan) else getattr(record, "part", record)
    return str(own.span.at) + _notes(record)


def _notes(record: Record) -> str:
    own = record if isinstance(record, PartPlan) else getattr(record, "part", record)
    entries = {**own.source.node.entries, **record.source.node.entries}
    return "".join(_given(key, entry.value.span) for key, entry in entries.items())


def _given(name: str, span: Span) -> str:
    """Return where the value of a `$name` was written, with the key `name`; empty if there is no
    such value."""
    if span.given is None:
        return ""
    return f", {name} from {span.given.at}" if name else f", from {span.given.at}"


def _part(use: PartPlan, word: str = "use") -> str:
    return "{" + ", ".join(_part_pairs(use, word)) + "}"


def _part_pairs(use: PartPlan, word: str) -> Iterator[str]:
    """Yield the name of a part and every parameter as `key: value`."""
    yield f"{word}: {use.name}"
    if word == "use" and use.alias != use.name:
        yield f"as: {use.alias}"
    yield from _pairs(use.params)


def _pairs(record: Any, is_terse: bool = False) -> Iterator[str]:
    """Yield every key that has a value as `key: value`. An empty path is omitted: it is a default
    that no mission can write."""
    for field in fields_of(record.__class__):
        value, kind = getattr(record, field.name), field.type
        if isinstance(kind, PartOf) and kind.word == field.key:
            yield from _part_pairs(value, kind.word)
        else:
            may_be_empty = field.shape in ("names", "integers") and not field.least
            is_nothing = value is None or value == {} or (value == () and not may_be_empty)
            is_default = is_terse and not field.required and value == field.default
            if not is_nothing and not is_default:
                yield f"{field.key}: {_text(value, kind, field)}"
        if field.name == "event" and getattr(record, "others", None) is EVENT_FIELD:
            yield from (f"{name}: {quoted(text)}" for name, text in record.fields)


def _flow(record: Any) -> str:
    """Return a record in one line."""
    if isinstance(record, ActionKeys):
        return _action(record)
    is_terse = getattr(record, "terse", False)
    pairs = [pair for pair in _pairs(record, is_terse) if pair != "event: ''"]
    return "{" + ", ".join(pairs) + "}"


def _action(action: ActionKeys) -> str:
    value = action.value
    text = _request(value) if isinstance(value, Request) else as_written(action.value_node)
    if action.part is not None:
        text = f"{{{', '.join(_pairs(action.part.params))}}}"
    elif action.target is not None:
        text = f"{{{action.target}: {text}}}"
    return f"{{{action.name}: {text}}}"


def _request(request: Request) -> str:
    """Return a state, with the values with which it is entered."""
    name, values = quoted(request.state), request.source.node
    return f"{{{name}: {as_written(values)}}}" if entries_of(values) else name


def as_written(node: Node) -> str:
    """Return a value as it was written, in one line."""
    if isinstance(node, Mapping):
        inside = (f"{key}: {as_written(entry.value)}" for key, entry in node.entries.items())
        return "{" + ", ".join(inside) + "}"
    if isinstance(node, Sequence):
        return "[" + ", ".join(as_written(item) for item in node.items) + "]"
    return quoted(node.text) if isinstance(node, Scalar) else ""


def _text(value: Any, kind: ValueType, field: Field) -> str:
    """Return the value of a key in one line."""
    if isinstance(kind, Numbers):
        return _numbers(value, kind.dimension)
    if isinstance(kind, ListOf):
        return f"[{', '.join(_text(item, kind.item, field) for item in value)}]"
    if isinstance(kind, MappingOf):
        inside = (f"{name}: {_text(item, kind.item, field)}" for name, item in _items(value, kind))
        return "{" + ", ".join(inside) + "}"
    if kind is STATE and NAMES["dotted"].match(value) and value not in _RESERVED:
        return str(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(kind, RecordOf) and not isinstance(value, PartPlan):
        return _flow(value)
    writer = _WRITERS.get(type(value))
    return quoted(str(value)) if writer is None else writer(value)


def _numbers(value: Any, dimension: Dimension) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_numbers(number, dimension) for number in value) + "]"
    return quantity(value, dimension)


_WRITERS: dict[type, Callable[[Any], str]] = {
    int: str, PartPlan: _part, Request: _request, Mapping: as_written, Sequence: as_written,
    Scalar: as_written, Unparsed: lambda value: quoted(value.text.text),
}  # fmt: skip


def quantity(value: float, dimension: Dimension) -> str:
    """Return the exact value with its unit: angles in degrees and ratios in percent if that is
    exact, otherwise in SI, or in a unit that needs fewer digits, such as `18 mm`."""
    factor, unit = _WRITTEN.get(dimension, (1.0, ""))
    text = f"{value / factor:g} {unit}"
    if unit and parse_quantity(text, dimension) == value:
        return text
    number = f"{value:g}"
    if float(number) == value:
        return f"{number} {dimension.si}".rstrip()
    scaled = (f"{value / factor:.15g} {unit}" for unit, factor in dimension.units.items())
    exact = [text for text in scaled if parse_quantity(text, dimension) == value]
    return min(exact, key=len, default=f"{value!r} {dimension.si}".rstrip())


def quoted(text: str) -> str:
    """Return `text` as a YAML scalar, quoted if necessary."""
    if text[:1] in _PLAIN_FIRST and text.replace("_", "").isalnum() and text not in _RESERVED:
        return text
    return "'" + text.replace("'", "''").replace("\n", " ") + "'"
