"""Nodes to records: one decoder for every declaration. What it decodes was judged by its shape
before (`kybflow.dsl.language.shape`); imports, `like` and parameters are gone."""

from __future__ import annotations

import functools
from collections.abc import Callable, Container, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.errors import KybflowError, UnitError
from kybflow.core.params import (
    TEXT,
    Choice,
    Field,
    ListOf,
    MappingOf,
    Numbers,
    RecordOf,
    ValueType,
    fields_of,
)
from kybflow.core.text import did_you_mean, nearest
from kybflow.core.units import format_quantity, parse_quantity
from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.expressions.tree import Unparsed
from kybflow.dsl.language.source import Record, Source
from kybflow.dsl.language.types import (
    CONDITION,
    EVENT,
    PHASE,
    REQUEST,
    SENSORS,
    STATE,
    TITLE,
    VERSION,
    AnyOf,
    PartOf,
    UsesOf,
)
from kybflow.dsl.plan import PartPlan, Request
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    describe,
    head_of,
    is_null,
    items_of,
)
from kybflow.dsl.reading.values import decode, diagonal

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog, PartSpec

CODES = {
    "KYB107": "A parameter that the part doesn't have.",
    "KYB108": "A part without a parameter that it needs.",
    "KYB140": "A part that no installed package offers.",
    "KYB141": "A part that can't be loaded.",
    "KYB142": "Two parts under one name in one list.",
    "KYB244": "Values for no state, or for several.",
}
_LABELS = {"trackers": "tracker", "drivers": "driver"}
_SURE = 0.75
_NONE: frozenset[str] = frozenset()


class _Layout(NamedTuple):
    """How a record is decoded: its keys, those that it can't do without, the part that it names,
    the record that stands flat in it, and which of the fields it has that every decoded one may."""

    keys: dict[str, Field]
    names: frozenset[str]
    required: tuple[Field, ...]
    part: Field | None
    flat: Field | None
    has_name: bool
    has_at: bool
    is_record: bool


@functools.cache
def _layout_of(cls: Any) -> _Layout:
    fields = fields_of(cls)
    part = next((f for f in fields if isinstance(f.type, PartOf) and f.type.word == f.key), None)
    flat = next((f for f in fields if isinstance(f.type, RecordOf) and f.type.flat), None)
    keys = {field.key: field for field in fields if field not in (part, flat)}
    own = cls.__dataclass_fields__
    has_at = "at" in own and not any(field.name == "at" for field in fields)
    required = tuple(field for field in fields if field.required)
    is_record = issubclass(cls, Record)
    return _Layout(keys, frozenset(keys), required, part, flat, "name" in own, has_at, is_record)


class Decoder:
    """Decodes the nodes of one mission. A part that several vehicles share is decoded once.
    `chains` are those that could be meant by the name of a behavior."""

    def __init__(self, catalog: Catalog, found: Findings, chains: Iterable[str] = ()) -> None:
        self.catalog = catalog
        self.found = found
        self._chains = tuple(f"chain.{name}" for name in chains)
        self._done: dict[tuple[str, int], tuple[Node, PartPlan | None]] = {}

    def record(
        self, cls: Any, node: Node, span: Span, inherited: bool = False, **given: Any
    ) -> Any:
        """The record that `node` says; None where it has errors. `span` is its place for reports,
        `given` are fields that are known already."""
        values = self.values(cls, node, span, inherited, **given)
        return None if values is None else cls(**values)

    def values(
        self, cls: Any, node: Node, span: Span, inherited: bool = False, **given: Any
    ) -> dict[str, Any] | None:
        """The fields of a record that `node` says; None where it has errors."""
        layout, before = _layout_of(cls), len(self.found.all)
        body = node if isinstance(node, Mapping) else Mapping({}, node.span)
        if layout.part is not None:
            given[layout.part.name] = self._part(layout.part.type, node, layout.names)
        if layout.flat is not None:
            given[layout.flat.name] = self._flat(layout.flat.type, body, layout.keys, span)
        for key, entry in body.entries.items():
            field = layout.keys.get(key)
            if field is None or field.name in given or is_null(entry.value):
                continue
            value = self._of(entry.value, field.type, field, entry)
            if value is not None:
                given[field.name] = value
        is_lacking = self._is_lacking(cls, given, body, span)
        if is_lacking or (len(self.found.all) > before and getattr(cls, "missing", "") == "KYB108"):
            return None
        if layout.is_record:
            given["source"] = Source(span, body, inherited)
        if layout.has_at:
            given["at"] = span.at
        return given

    def _flat(self, kind: Any, body: Mapping, keys: Container[str], span: Span) -> Any:
        """The record whose keys stand beside those of another."""
        beside = {key: entry for key, entry in body.entries.items() if key not in keys}
        title = kind.cls.__name__.lower()
        return self.parameters(kind.cls, Mapping(beside, body.span), title, span)

    def _is_lacking(self, cls: Any, given: dict[str, Any], body: Mapping, span: Span) -> bool:
        """Whether a record can't be made of `given`; a key that is not written has its finding."""
        lacking = [f for f in _layout_of(cls).required if given.get(f.name) is None]
        for field in lacking:
            if field.name not in given and body.get(field.key) is None and field.needed is None:
                self._missing(cls, field, body, span)
        return bool(lacking)

    def _missing(self, cls: Any, field: Field, body: Mapping, span: Span) -> None:
        if cls.missing == "KYB108":
            self._missing_parameter(cls.title, field, body, _layout_of(cls).keys, span)
        else:
            self.found.report("KYB102", f"a {cls.title} needs `{field.key}`", head_of(body))

    def _missing_parameter(
        self, part: str, field: Field, body: Mapping, known: Iterable[str], span: Span
    ) -> None:
        if nearest(field.key, [key for key in body.entries if key not in known]):
            return  # the misspelt key is reported already
        message = f"`{part}` needs `{field.key}`"
        self.found.report("KYB108", message, span, help=how_to_write(field))

    def _of(self, node: Node, kind: ValueType, field: Field, entry: MappingEntry | None) -> Any:
        reader = _ALONE.get(kind) or _READERS.get(type(kind), Decoder._plain)
        return reader(self, node, kind, field, entry)

    def _plain(self, node: Node, kind: Any, field: Field, *_: Any) -> Any:
        points: Iterable[Node] = ()
        if isinstance(kind, ListOf) and kind.item is TEXT:
            points = [item for item in items_of(node) if isinstance(item, Sequence)]
        elif isinstance(kind, Choice) and isinstance(node, Sequence):
            points = (node,)
        for point in points:
            self.misplaced(point, field.key)
        if points:
            return None
        return decode(node, field, self.found)

    def _text(self, node: Node, kind: Any, field: Field, *_: Any) -> Any:
        if isinstance(node, Scalar):
            return Unparsed(node.as_text) if kind is CONDITION else node.text
        self.misplaced(node, field.key)
        return None

    def misplaced(self, node: Node, key: str) -> None:
        """KYB103 for a point where a name is needed: a parameter or a point of the world brought it
        there after the shape of the file was judged."""
        if isinstance(node, Sequence):
            message = f"`{key}` must be a name, but this is a point"
            self.found.report("KYB103", message, node.span)

    def _as_written(self, node: Node, *_: Any) -> Any:
        return node

    def _version(self, *_: Any) -> Any:
        return 1

    def request(self, entry: MappingEntry) -> Request | None:
        """The state that the value of a vehicle asks for; None, and a finding, for something
        else."""
        request: Request | None = self._request(entry.value, None, Field(key=entry.key.text))
        return request

    def _request(self, node: Node, _: Any, field: Field, *__: Any) -> Any:
        """The state that is asked for, with the mapping of its values as its source."""
        if isinstance(node, Scalar):
            return Request(node.text, source=Source(node.as_text.span))
        if isinstance(node, Mapping) and len(node.entries) == 1:
            [asked] = node.entries.values()
            place = asked.key.as_text.span
            if isinstance(asked.value, Mapping):
                return Request(asked.key.text, source=Source(place, asked.value))
            if is_null(asked.value):
                return Request(asked.key.text, source=Source(place))
        if isinstance(node, Sequence):
            self.misplaced(node, field.key)
            return None
        message = f"`{field.key}` is asked for what is no state with its values"
        hint = f"write `{field.key}: STATE` or `{field.key}: {{STATE: {{...}}}}`"
        self.found.report("KYB244", message, node.span, help=hint)
        return None

    def _mapping(self, node: Node, kind: Any, *_: Any) -> Any:
        if not isinstance(node, Mapping):
            return None
        values: dict[str, Any] = {}
        for name, entry in node.entries.items():
            if not is_null(entry.value):
                field = Field(name=name, type=kind.item, key=name)
                value = self._of(entry.value, kind.item, field, entry)
                if value is not None:
                    values[name] = value
        return values if kind.as_dict else tuple(values.values())

    def _nested(
        self, node: Node, kind: Any, field: Field, entry: MappingEntry | None = None
    ) -> Any:
        if not isinstance(node, Mapping) and entry is None:
            return None
        if not issubclass(kind.cls, Record):
            assert isinstance(node, Mapping)
            head = node.span if entry is None else entry.key.span
            return self.parameters(kind.cls, node, kind.cls.title, head)
        own = {"name": field.key} if entry is not None and _layout_of(kind.cls).has_name else {}
        span = node.span if entry is None else entry.key.span
        return self.record(kind.cls, node, span, entry is not None and entry.inherited, **own)

    def _list(self, node: Node, kind: Any, field: Field, *_: Any) -> Any:
        """A list; a record with errors is left out."""
        if not isinstance(kind.item, RecordOf):
            return self._plain(node, kind, field)
        items = (item for item in items_of(node) if isinstance(item, Mapping))
        records = [self.record(kind.item.cls, item, item.span) for item in items]
        return tuple(one for one in records if one is not None)

    def _sensors(self, node: Node, *_: Any) -> Any:
        return tuple(self.part("sensors", item) for item in items_of(node) or (node,))

    def _uses(self, node: Node, kind: Any, field: Field, *_: Any) -> Any:
        """A list of parts, or of records of parts, whose names differ."""
        uses: list[Any] = []
        for item in items_of(node):
            if isinstance(kind.item, RecordOf):
                use = self.record(kind.item.cls, item, item.span)
            else:
                use = self._of(item, kind.item, field, None)
            if use is None:
                continue
            alias = _part_in(use).alias
            twin = next((u for u in uses if _part_in(u).alias == alias), None)
            if twin is None:
                uses.append(use)
            else:
                self._twice(_part_in(twin), _part_in(use), node.span)
        return tuple(uses)

    def _twice(self, first: PartPlan, second: PartPlan, written: Span) -> None:
        """KYB142 for two parts of the list `written`; at the one of the list where the other is
        from a stack."""
        message = f"`{second.alias}` is in this list twice"
        is_first, is_second = (use.span.is_in(written) for use in (first, second))
        if is_first == is_second:
            notes = (f"first at {first.span.at}",)
            hint = "give one of them a name of its own with `as: NAME`"
            self.found.report("KYB142", message, second.span, notes=notes, help=hint)
            return
        own, other = (first, second) if is_first else (second, first)
        notes = (f"the stack has it at {other.span.at}",)
        hint = "leave out yours: the stack has it"
        self.found.report("KYB142", message, own.span, notes=notes, help=hint)

    def part(self, kind: str, node: Node) -> PartPlan | None:
        """The part that `node` names with `use`, or alone."""
        return self._part(PartOf("part", False, kind), node)

    def _part(self, kind: Any, node: Node, own: frozenset[str] = _NONE) -> PartPlan | None:
        """The part that `node` names; `own` are the keys beside the part's parameters. A node that
        several vehicles share is decoded once."""
        key = (kind.kind, id(node))
        if key not in self._done:
            self._done[key] = (node, self._decoded_part(kind, node, own))
        return self._done[key][1]

    def _use(self, node: Node, kind: Any, *_: Any) -> PartPlan | None:
        return self._part(kind, node)

    def _decoded_part(self, kind: PartOf, node: Node, own: frozenset[str]) -> PartPlan | None:
        word, name, label = kind.word, node, None
        body = Mapping({}, node.span)
        if isinstance(node, Mapping):
            named = node.get(word)
            if isinstance(named, Sequence):
                self.misplaced(named, word)
                return None
            name = named if isinstance(named, Scalar) else node
            beside = own | ({word, "as"} if word == "use" else {word})
            entries = {k: e for k, e in node.entries.items() if k not in beside}
            body = Mapping(entries, node.span)
            label = node.get("as") if word == "use" else None
        if isinstance(node, Sequence):
            self.misplaced(node, kind.kind[:-1])
            return None
        if not isinstance(name, Scalar):
            message = f"a part is needed, but this is {describe(node)}"
            if isinstance(node, Mapping):
                message = f"`{word}` is missing"
            self.found.report("KYB102", message, node.span, help=f"write `{word}: NAME`")
            return None
        spec = self.spec(kind.kind, name)
        if spec is None:
            return None
        params = self.parameters(spec.params, body, spec.name, name.span, own)
        if params is None:
            return None
        alias = label.text if isinstance(label, Scalar) else name.text
        option = _LABELS.get(kind.kind) or f"{kind.kind}.{alias}"
        option = alias if kind.kind == "faults" else option
        source = Source(name.span, body)
        return PartPlan(spec.name, spec.cls, params, option, name.span.at, source=source)

    def spec(self, kind: str, name: Scalar) -> PartSpec | None:
        """The part called `name`; None, and a finding, when there is none or it can't be loaded."""
        if name.text not in self.catalog.names(kind):
            more = self._chains if kind == "behaviors" else ()
            meant = f"chain.{name.text}"
            hint = did_you_mean(name.text, (*self.catalog.names(kind), *more))
            if meant in more:
                hint = f"did you mean `{meant}`?"
            message = f"no {kind[:-1]} is called `{name.text}`"
            self.found.report("KYB140", message, name.span, help=hint)
            return None
        try:
            return self.catalog.get(kind, name.text)
        except (KybflowError, ImportError) as error:
            message = f"the {kind[:-1]} `{name.text}` can't be loaded: {error}"
            hint = "mend or update the package that offers it"
            self.found.report("KYB141", message, name.span, help=hint)
            return None

    def parameters(
        self,
        cls: Any,
        body: Mapping,
        part: str,
        head: Span,
        beside: frozenset[str] = _NONE,
    ) -> Any:
        """The parameters of `part` as `cls`; None when they have errors. `head` is the place for
        what is missing, `beside` are keys that could be meant too."""
        layout, values, before = _layout_of(cls), dict[str, Any](), len(self.found.all)
        keys = layout.keys
        for key, entry in body.entries.items():
            field = keys.get(key)
            if field is None:
                message = f"`{key}` is no parameter of `{part}`"
                hint = meant(part, key, body, keys, beside)
                self.found.report("KYB107", message, entry.key.span, help=hint)
            elif field.required or not is_null(entry.value):
                values[field.name] = decode(entry.value, field, self.found)
        for field in layout.required:
            if field.key not in body.entries:
                self._missing_parameter(part, field, body, keys, head)
        return None if len(self.found.all) > before else cls(**values)


_Reader = Callable[..., Any]
_ALONE: dict[ValueType, _Reader] = {
    CONDITION: Decoder._text, EVENT: Decoder._text, STATE: Decoder._text, TITLE: Decoder._text,
    TEXT: Decoder._text, REQUEST: Decoder._request, PHASE: Decoder._as_written,
    VERSION: Decoder._version, SENSORS: Decoder._sensors,
}  # fmt: skip
_READERS: dict[type[ValueType], _Reader] = {
    UsesOf: Decoder._uses, PartOf: Decoder._use, MappingOf: Decoder._mapping,
    RecordOf: Decoder._nested, ListOf: Decoder._list, AnyOf: Decoder._as_written,
}  # fmt: skip
"""What reads a value, by its type; `decode` reads all others."""


def _part_in(use: Any) -> PartPlan:
    part: PartPlan = use if isinstance(use, PartPlan) else use.part
    return part


def meant(
    part: str, key: str, node: Mapping, known: dict[str, Field], beside: frozenset[str]
) -> str:
    """The help line for an unknown key: a parameter with a similar name, a key beside the
    parameters, the one parameter that fits the value; else every parameter."""
    if not known:
        return f"`{part}` has no parameters"
    if key.lower() in known and key.lower() in node.entries:
        return f"`{key.lower()}` is written, too: remove one of them"
    near = nearest(key, known) or nearest(key, beside, _SURE)
    if not near and "for" in beside:  # a fault: what it is to do could be meant as well as when
        return did_you_mean(key, {*known, *beside})
    if not near:
        free = [field for name, field in known.items() if name not in node.entries]
        fitting = list(_fitting(node.entries[key].value, free))
        near = fitting[0] if len(fitting) == 1 else ""
    if near:
        return did_you_mean(near, {*known, *beside})
    names = ", ".join(f"`{name}`" for name in sorted(known))
    return f"the parameters of `{part}` are {names}"


def _fitting(value: Node, known: Iterable[Field]) -> Iterator[str]:
    """The parameters that can have a value: lists of the same depth, quantities with its unit."""
    for field in known:
        kind = field.type
        depth = len(kind.size) if isinstance(kind, Numbers) else int(isinstance(kind, ListOf))
        if isinstance(value, Sequence):
            is_path = any(isinstance(item, Sequence) for item in value.items)
            if depth == 1 + is_path:
                yield field.key
        if isinstance(value, Scalar) and isinstance(kind, Numbers) and not depth:
            try:
                parse_quantity(value.text, kind.dimension)
            except UnitError:
                continue
            if not value.text.strip()[-1:].isdigit():
                yield field.key


def how_to_write(field: Field) -> str:
    """A parameter as an author writes it, and what it is."""
    about = field.help.split(". ")[0].rstrip(".")
    example, kind = "...", field.type
    if isinstance(kind, Numbers):
        example = kind.dimension.example
        if field.shape == "matrix":
            example = diagonal(kind.size, example, format_quantity(0.0, kind.dimension))
        elif kind.size:
            example = f"[{', '.join([example] * 3)}]"
            example = f"[{example}, ...]" if len(kind.size) == 2 else example
    how = f"write `{field.key}: {example}`"
    return f"{how}: {about[:1].lower()}{about[1:]}" if about else how
