"""Decode nodes to records. `kybflow.dsl.language.judge` has already checked the shape of the file,
and imports, `like` and parameters are resolved."""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Iterator
from typing import TYPE_CHECKING, Any, cast

from kybflow.core.errors import KybflowError
from kybflow.core.params import TEXT, Choice, Field, ListOf, MappingOf, Numbers, RecordOf, ValueType
from kybflow.core.text import did_you_mean, nearest
from kybflow.core.units import is_quantity
from kybflow.dsl.diagnostics import Collector, Span
from kybflow.dsl.expressions.tree import Unparsed
from kybflow.dsl.language.records import (
    CONDITION,
    EMPTY,
    EVENT,
    PHASE,
    REQUEST,
    SENSORS,
    STATE,
    TITLE,
    VERSION,
    AnyOf,
    PartOf,
    Record,
    Source,
    UsesOf,
    layout_of,
    part_of,
)
from kybflow.dsl.plan import PartPlan, Request
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
    head_of,
    is_null,
    items_of,
)
from kybflow.dsl.reading.values import decode_value, example_of

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CODES = {
    "KYB107": "The part doesn't have this parameter.",
    "KYB108": "A required parameter of a part is missing.",
    "KYB140": "No installed package has this part.",
    "KYB141": "A part can't be loaded.",
    "KYB142": "A list has two parts with the same name.",
    "KYB244": "Values are given for no state, or for several.",
}
_LABELS = {"trackers": "tracker", "drivers": "driver"}
_LIKENESS = 0.75


class Decoder:
    """Decodes the nodes of one mission; a part that several vehicles share is decoded once.

    chains: the names of the chains, for hints about unknown behaviors.
    """

    def __init__(self, catalog: Catalog, found: Collector, chains: Iterable[str] = ()) -> None:
        self.catalog = catalog
        self.found = found
        self._chains = tuple(f"chain.{name}" for name in chains)
        self._parts: dict[tuple[str, int], tuple[Node, PartPlan | None]] = {}

    def record(
        self, cls: Any, node: Node, span: Span, inherited: bool = False, **given: Any
    ) -> Any:
        """Return the record at `node`, or None if it has errors, which are reported.

        cls: the class of the record. span: its source location for reports. inherited: whether it
        came through `like`. given: fields that are already known.
        """
        values = self.values(cls, node, span, inherited, **given)
        return None if values is None else cls(**values)

    def values(
        self, cls: Any, node: Node, span: Span, inherited: bool = False, **given: Any
    ) -> dict[str, Any] | None:
        """Return the fields of the record at `node` by name, or None if it has errors. The
        arguments are those of `record`."""
        layout, before = layout_of(cls), len(self.found.all)
        like_a_part = cls.missing == "KYB108"  # a `null` is judged as its parameters' are
        body = node if isinstance(node, Mapping) else Mapping({}, node.span)
        if layout.part is not None:
            given[layout.part_name] = self.part(layout.part, node, layout.own.keys())
        if layout.flat is not None:
            own = {key: entry for key, entry in body.entries.items() if key not in layout.own}
            kind: Any = layout.flat.type
            given[layout.flat.name] = self.parameters(
                kind.cls, Mapping(own, body.span), kind.cls.__name__.lower(), span
            )
        for key, entry in body.entries.items():
            field = layout.own.get(key)
            if field is None or field.name in given:
                continue
            is_said = not is_null(entry.value) or (like_a_part and field.required)
            value = self._value(entry, field) if is_said else None
            if value is not None:
                given[field.name] = value
        lacking = [field for field in layout.required if given.get(field.name) is None]
        for field in lacking:
            written = field.key in body.entries if like_a_part else body.get(field.key) is not None
            if field.name not in given and not written and field.needed is None:
                self._missing(cls.missing, cls.title, field, body, layout.own, span)
        if lacking or (len(self.found.all) > before and like_a_part):
            return None
        given["source"] = Source(span, body, inherited)
        if "at" in layout.computed:
            given["at"] = span.at
        return given

    def parameters(
        self, cls: Any, body: Mapping, part: str, head: Span, beside: Collection[str] = ()
    ) -> Any:
        """Return the parameters of `part` in `body` as `cls`, or None if they have errors, which
        are reported.

        head: the location at which missing parameters are reported. beside: other valid keys, which
        an unknown key could have been meant for.
        """
        layout, values, before = layout_of(cls), dict[str, Any](), len(self.found.all)
        keys = layout.own
        for key, entry in body.entries.items():
            field = keys.get(key)
            if field is None:
                message = f"`{key}` is not a parameter of `{part}`"
                hint = meant(part, key, body, keys, beside)
                self.found.report("KYB107", message, entry.key.span, help=hint)
            elif field.required or not is_null(entry.value):
                values[field.name] = decode_value(entry.value, field, self.found)
        for field in layout.required:
            if field.key not in body.entries:
                self._missing("KYB108", part, field, body, keys, head)
        return None if len(self.found.all) > before else cls(**values)

    def _missing(
        self, code: str, owner: str, field: Field, body: Mapping, known: Container[str], span: Span
    ) -> None:
        """Report KYB102 for a missing key of a record, or KYB108 for a missing parameter."""
        if code == "KYB102":
            message = f"a {owner} needs `{field.key}`"
            self.found.report(code, message, head_of(body), help=how_to_write(field))
        elif not nearest(field.key, [key for key in body.entries if key not in known]):
            # otherwise the misspelt key is already reported
            message = f"`{owner}` needs `{field.key}`"
            self.found.report(code, message, span, help=how_to_write(field))

    def part(self, kind: PartOf | str, node: Node, beside: Collection[str] = ()) -> PartPlan | None:
        """Return the part of a kind that `node` names, alone or with its parameters, or None if it
        has errors. beside: the keys in `node` that are not parameters. A node that vehicles share
        is decoded once."""
        kind = part_of(kind) if isinstance(kind, str) else kind
        key = (kind.kind, id(node))
        if key not in self._parts:
            self._parts[key] = (node, self._part(kind, node, beside))
        return self._parts[key][1]

    def _part(self, kind: PartOf, node: Node, beside: Collection[str]) -> PartPlan | None:
        word, name, label = kind.word, node, None
        body = Mapping({}, node.span)
        if isinstance(node, Mapping):
            name = node.get(word) or node
            own = {word, "as", *beside} if word == "use" else {word, *beside}
            body = Mapping({k: e for k, e in node.entries.items() if k not in own}, node.span)
            label = node.get("as") if word == "use" else None
        if isinstance(name, Sequence):
            self.misplaced(name, kind.kind[:-1] if name is node else word)
            return None
        if not isinstance(name, Scalar):
            message = f"`{word}` is missing"
            self.found.report("KYB102", message, node.span, help=f"write `{word}: NAME`")
            return None
        alias = label.text if isinstance(label, Scalar) else name.text
        option = _LABELS.get(kind.kind) or f"{kind.kind}.{alias}"
        option = alias if kind.kind == "faults" else option
        return self.named_part(kind.kind, name, body, option, beside)

    def named_part(
        self, kind: str, name: Scalar, body: Mapping, label: str, beside: Collection[str] = ()
    ) -> PartPlan | None:
        """Return the part called `name` with its parameters in `body`, or None if either has
        errors."""
        if name.text not in self.catalog.names(kind):
            more = self._chains if kind == "behaviors" else ()
            chain = f"chain.{name.text}"
            hint = did_you_mean(name.text, (*self.catalog.names(kind), *more))
            if chain in more:
                hint = f"did you mean `{chain}`?"
            message = f"no {kind[:-1]} is called `{name.text}`"
            self.found.report("KYB140", message, name.span, help=hint)
            return None
        try:
            spec = self.catalog.get(kind, name.text)
        except (KybflowError, ImportError) as error:
            message = f"the {kind[:-1]} `{name.text}` can't be loaded: {error}"
            hint = "correct or update the package that provides it"
            self.found.report("KYB141", message, name.span, help=hint)
            return None
        params = self.parameters(spec.params, body, spec.name, name.span, beside)
        if params is None:
            return None
        source = Source(name.span, body)
        return PartPlan(spec.name, spec.cls, params, label, name.span.at, source=source)

    def misplaced(self, node: Node, key: str) -> bool:
        """Report KYB103 and return True if `node` is a point where a name is needed. A parameter or
        a point of the world can put one there after the shape was checked."""
        if isinstance(node, Sequence):
            message = f"`{key}` must be a name, but this is a point"
            self.found.report("KYB103", message, node.span)
        return isinstance(node, Sequence)

    def request(self, entry: MappingEntry) -> Request | None:
        """Return the state that a vehicle is requested to enter, with its values as the source.
        Report KYB244 and return None if the entry is anything else."""
        node, name = entry.value, entry.key.text
        if isinstance(node, Scalar):
            return Request(node.text, source=Source(node.as_text.span))
        if isinstance(node, Mapping) and len(node.entries) == 1:
            [asked] = node.entries.values()
            values = asked.value if isinstance(asked.value, Mapping) else EMPTY
            if values is asked.value or is_null(asked.value):
                source = Source(asked.key.as_text.span, values)
                return Request(asked.key.text, source=source)
        if not self.misplaced(node, name):
            message = f"`{name}` needs a state"
            hint = f"write `{name}: STATE` or `{name}: {{STATE: {{...}}}}`"
            self.found.report("KYB244", message, node.span, help=hint)
        return None

    def _value(self, entry: MappingEntry, field: Field) -> Any:
        read = _ALONE.get(field.type) or _READERS.get(type(field.type), Decoder._plain)
        return read(self, entry, field)

    def _plain(self, entry: MappingEntry, field: Field) -> Any:
        node, kind = entry.value, field.type
        names: Iterable[Node] = ()
        if isinstance(kind, ListOf) and kind.item is TEXT:
            names = items_of(node)
        elif isinstance(kind, Choice):
            names = (node,)
        points = [name for name in names if self.misplaced(name, field.key)]
        return None if points else decode_value(node, field, self.found)

    def _text(self, entry: MappingEntry, field: Field) -> Any:
        node = entry.value
        if isinstance(node, Scalar):
            return Unparsed(node.as_text) if field.type is CONDITION else node.text
        self.misplaced(node, field.key)
        return None

    def _mapping(self, entry: MappingEntry, field: Field) -> Any:
        kind: Any = field.type
        values: dict[str, Any] = {}
        for name, inner in entries_of(entry.value).items():
            if not is_null(inner.value):
                one = inner._replace(inherited=inner.inherited or entry.inherited)
                value = self._value(one, Field(name=name, type=kind.item, key=name))
                if value is not None:
                    values[name] = value
        return values if kind.as_dict else tuple(values.values())

    def _nested(self, entry: MappingEntry, field: Field) -> Any:
        """Return a nested record, whose key is its source location for reports."""
        kind: Any = field.type
        if issubclass(kind.cls, Record):
            own = {"name": field.key} if "name" in layout_of(kind.cls).computed else {}
            return self.record(kind.cls, entry.value, entry.key.span, entry.inherited, **own)
        assert isinstance(entry.value, Mapping)
        return self.parameters(kind.cls, entry.value, kind.cls.title, entry.key.span)

    def _list(self, entry: MappingEntry, field: Field) -> Any:
        """Return a list without the records that have errors."""
        kind: Any = field.type
        if not isinstance(kind.item, RecordOf):
            return self._plain(entry, field)
        items = (item for item in items_of(entry.value) if isinstance(item, Mapping))
        records = [self.record(kind.item.cls, item, item.span) for item in items]
        return tuple(one for one in records if one is not None)

    def _uses(self, entry: MappingEntry, field: Field) -> Any:
        """Return a list of parts, or of records of parts, and report a name that occurs twice."""
        kind: Any = field.type
        uses: list[Any] = []
        parts: dict[str, PartPlan] = {}
        for item in items_of(entry.value):
            if isinstance(kind.item, RecordOf):
                use = self.record(kind.item.cls, item, item.span)
            else:
                use = self.part(kind.item, item)
            if use is None:
                continue
            part: PartPlan = getattr(use, "part", use)
            first = parts.get(part.alias)
            if first is None:
                parts[part.alias] = part
                uses.append(use)
                continue
            # if a stack brings one of the two, report the one that is written in this list
            is_first, is_second = (use.span.is_in(entry.value.span) for use in (first, part))
            own, other = (first, part) if is_first and not is_second else (part, first)
            note, hint = f"the stack has it at {other.span.at}", "leave out yours: the stack has it"
            if is_first == is_second:
                note = f"first at {first.span.at}"
                hint = "give one of them a name of its own with `as: NAME`"
                if not is_first:
                    note = f"two stacks of {entry.value.span.at} have it"
                    hint = "leave out one of the stacks"
            message = f"`{part.alias}` is in this list twice"
            self.found.report("KYB142", message, own.span, notes=(note,), help=hint)
        return tuple(uses)


_Reader = Callable[[Decoder, MappingEntry, Field], Any]
_ALONE: dict[ValueType, _Reader] = {
    CONDITION: Decoder._text, EVENT: Decoder._text, STATE: Decoder._text, TITLE: Decoder._text,
    TEXT: Decoder._text,
    SENSORS: lambda decoder, entry, _: tuple(
        decoder.part("sensors", item) for item in items_of(entry.value) or (entry.value,)
    ),
    REQUEST: lambda decoder, entry, _: decoder.request(entry),
    PHASE: lambda _, entry, __: entry.value,
    VERSION: lambda *_: 1,
}  # fmt: skip
_READERS: dict[type[ValueType], _Reader] = {
    UsesOf: Decoder._uses, MappingOf: Decoder._mapping, RecordOf: Decoder._nested,
    ListOf: Decoder._list,
    PartOf: lambda decoder, entry, field: decoder.part(cast("PartOf", field.type), entry.value),
    AnyOf: lambda _, entry, __: entry.value,
}  # fmt: skip
"""The function that decodes a value of each type; `decode_value` decodes all others."""


_REPEATS = frozenset({"repeat", "repeats", "loop", "loops", "times", "count", "repetitions"})


def meant(
    part: str, key: str, node: Mapping, known: dict[str, Field], beside: Collection[str]
) -> str:
    """Return the hint for an unknown key: a similar parameter or other key, or else the one
    parameter that fits the value, or else all parameters."""
    if not known:
        return f"`{part}` has no parameters"
    if key.lower() in known and key.lower() in node.entries:
        return f"remove `{key}`: `{key.lower()}` is already set"
    if key in _REPEATS and "next" in beside:
        own = "`laps: 3` flies several; " if "laps" in known else ""
        return f"{own}a state is entered again where another leads back to it, as by `then: NAME`"
    near = nearest(key, known) or nearest(key, beside, _LIKENESS)
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
    """Yield the parameters that could have a value: lists of the same depth, or quantities in its
    unit."""
    for field in known:
        kind = field.type
        depth = len(kind.size) if isinstance(kind, Numbers) else int(isinstance(kind, ListOf))
        if isinstance(value, Sequence):
            is_path = any(isinstance(item, Sequence) for item in value.items)
            if depth == 1 + is_path:
                yield field.key
        elif isinstance(value, Scalar) and isinstance(kind, Numbers) and not depth:
            has_unit = not value.text.strip()[-1:].isdigit()
            if has_unit and is_quantity(value.text, kind.dimension):
                yield field.key


def how_to_write(field: Field) -> str:
    """Return the hint that shows how to write a parameter, and its description."""
    about = field.help.split(". ")[0].rstrip(".")
    example = example_of(field.type) if isinstance(field.type, Numbers) else "..."
    how = f"write `{field.key}: {example}`"
    return f"{how}: {about[:1].lower()}{about[1:]}" if about else how
