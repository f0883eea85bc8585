"""Nodes to records: one decoder for every declaration.

It judges a file before anything is resolved (`judging`: a `$name` may stand for a value, `like` may
bring what is missing, no part is looked up), and afterwards decodes values, parts and records.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from kybflow.core.errors import KybflowError, UnitError
from kybflow.core.params import (
    BOOLEAN,
    FILE,
    FILE_PATH,
    INTEGER,
    TEXT,
    Choice,
    Field,
    ListOf,
    MappingOf,
    Numbers,
    RecordOf,
    ValueType,
    fields_of,
    is_needed,
)
from kybflow.core.text import did_you_mean, nearest
from kybflow.core.units import parse_quantity
from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.expressions.tree import Unparsed
from kybflow.dsl.language.schema import NAMES, PARAMETER, PLACE, TITLE_LENGTH, event_fields
from kybflow.dsl.language.source import Record, Source
from kybflow.dsl.language.types import (
    CONDITION,
    EVENT,
    EVENT_FIELD,
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
    to_json,
)
from kybflow.dsl.reading.values import decode

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
_TEXTS = (CONDITION, EVENT, STATE, TITLE, TEXT)
_LABELS = {"trackers": "tracker", "drivers": "driver"}
_JSON = {str: "string", bool: "boolean", int: "number", float: "number", type(None): "null"}
_SURE = 0.75


class Decoder:
    """Decodes the nodes of one mission or file. A part that several vehicles share is decoded once.
    `chains` are those that could be meant by the name of a behavior."""

    def __init__(
        self,
        catalog: Catalog | None,
        found: Findings,
        chains: Iterable[str] = (),
        judging: bool = False,
    ) -> None:
        self._catalog = catalog
        self.found = found
        self._chains = tuple(f"chain.{name}" for name in chains)
        self._judging = judging
        self._done: dict[tuple[str, int], tuple[Node, PartPlan | None]] = {}

    @property
    def catalog(self) -> Catalog:
        """The parts at hand; there are none while a file is judged."""
        assert self._catalog is not None
        return self._catalog

    def apart(self, found: Findings) -> Decoder:
        """A decoder that reports elsewhere."""
        return Decoder(self._catalog, found, judging=self._judging)

    def record(
        self, cls: Any, node: Node, span: Span, inherited: bool = False, **given: Any
    ) -> Any:
        """The record that `node` says; None where it has errors. `span` is its place for reports,
        `given` are fields that are known already."""
        before = len(self.found.all)
        body = _body(node)
        values, fields = dict(given), fields_of(cls)
        keys = frozenset(field.key for field in fields)
        for field in fields:
            if field.name in given:
                continue
            kind = field.type
            if isinstance(kind, PartOf) and kind.word == field.key:
                value = self._part(kind, node, keys)
            elif isinstance(kind, RecordOf) and kind.flat:
                beside = Mapping(
                    {k: e for k, e in body.entries.items() if k not in keys}, body.span
                )
                value = self._flat(kind.cls, beside, span)
                keys |= {own.key for own in fields_of(kind.cls)}
            else:
                value = self._entry(cls, field, body, keys, span)
            if value is not None:
                values[field.name] = value
        if self._judging:
            if len(body.entries) < getattr(cls, "least", 0):
                self._refuse(node)
            self._judge_keys(cls, body, keys)
            return None
        lacking = [f.name for f in fields if f.required and f.name not in values]
        is_wrong = len(self.found.all) > before
        if lacking or (is_wrong and getattr(cls, "missing", "") == "KYB108"):
            return None
        if issubclass(cls, Record):
            values["source"] = Source(span, body, inherited)
            if "at" in cls.__dataclass_fields__ and not any(f.name == "at" for f in fields):
                values.setdefault("at", span.at)
        return cls(**values)

    def _flat(self, cls: Any, body: Mapping, span: Span) -> Any:
        """A record whose keys stand beside those of another."""
        if self._judging:
            for field in fields_of(cls):
                entry = body.entries.get(field.key)
                if entry is not None and not is_null(entry.value):
                    self.value(entry.value, field)
            return None
        return self.parameters(cls, body, getattr(cls, "title", "") or cls.__name__.lower(), span)

    def _entry(
        self, cls: Any, field: Field, body: Mapping, keys: frozenset[str], span: Span
    ) -> Any:
        """The value of one key; None where it is not written or has errors."""
        entry = body.entries.get(field.key)
        if entry is not None and not is_null(entry.value):
            return self.value(entry.value, field, entry)
        if self._judging:
            is_free = hasattr(cls, "like") and cls.like and "like" in body.entries
            if is_needed(cls, field) and not is_free:
                self.found.report("KYB102", f"`{field.key}` is missing", body.span)
        elif field.required and field.needed is None:
            self._missing(cls, field, body, keys, span)
        return None

    def _missing(
        self, cls: Any, field: Field, body: Mapping, keys: frozenset[str], span: Span
    ) -> None:
        title = getattr(cls, "title", "")
        if getattr(cls, "missing", "") == "KYB102":
            self.found.report("KYB102", f"a {title} needs `{field.key}`", head_of(body))
        else:
            self._missing_parameter(title, field, body, keys, span)

    def _missing_parameter(
        self, part: str, field: Field, body: Mapping, known: Iterable[str], span: Span
    ) -> None:
        if nearest(field.key, [key for key in body.entries if key not in known]):
            return  # the misspelt key is reported already
        message = f"`{part}` needs `{field.key}`"
        self.found.report("KYB108", message, span, help=how_to_write(field))

    def _judge_keys(self, cls: Any, body: Mapping, keys: frozenset[str]) -> None:
        """Report a key that the record does not have, and judge those that any name may have."""
        others, fields = getattr(cls, "others", None), fields_of(cls)
        parts = [f.type for f in fields if isinstance(f.type, PartOf) and f.type.word == f.key]
        texts = {"like"} if getattr(cls, "like", "") else set()
        texts |= {"as", "stack"} if parts and parts[0].word == "use" else set()
        for key, entry in body.entries.items():
            if key in keys or parts and key not in texts:
                continue
            if key not in texts and not _may_be_called(key, others):
                self._refuse(entry.key)
            if not is_null(entry.value) and (key in texts or others is not None):
                kind = TEXT if key in texts else others
                self.value(entry.value, Field(key, kind, key=key))

    def value(self, node: Node, field: Field, entry: MappingEntry | None = None) -> Any:
        """The value of a key."""
        return self._of(node, field.type, field, entry)

    def _of(self, node: Node, kind: ValueType, field: Field, entry: MappingEntry | None) -> Any:
        if isinstance(kind, UsesOf):
            return self._uses(node, kind, field)
        if kind == SENSORS:
            items = items_of(node) or (node,)
            return tuple(self.part("sensors", item) for item in items)
        if isinstance(kind, PartOf):
            return self._part(kind, node, frozenset())
        if isinstance(kind, MappingOf):
            return self._mapping(node, kind, field)
        if isinstance(kind, RecordOf):
            return self._nested(node, kind, field, entry)
        if isinstance(kind, ListOf) and isinstance(kind.item, RecordOf):
            return self._records(node, kind.item, field)
        if isinstance(kind, AnyOf):
            return self._any(node, kind, field)
        if kind == REQUEST:
            return self._request(node, field)
        if kind == PHASE:
            return self._phase(node, field)
        if kind == VERSION:
            return 1 if to_json(node) == 1 and node.text[0] in "1+" else self._refuse(node)
        if kind in _TEXTS:
            return self._text(node, kind, field)
        return self._plain(node, field)

    def _refuse(self, node: Node) -> None:
        """What judging reports of a wrong shape; `jsonschema` says what is wrong."""
        self.found.report("KYB103", "another value is needed", node.span)

    def _plain(self, node: Node, field: Field) -> Any:
        if not self._judging:
            return decode(node, field, self.found)
        kind = field.type
        if _stands_in(node, kind):
            return None
        if kind in (FILE, FILE_PATH):
            return self._text(node, TEXT, field)
        if isinstance(node, Sequence) and len(node.items) < field.least:
            self._refuse(node)
        if isinstance(kind, Numbers) and kind.size and isinstance(node, Sequence):
            inner = Numbers("scalar" if len(kind.size) == 1 else "vector", False, kind.dimension,
                            kind.size[1:])  # fmt: skip
            one = Field(field.name, inner, key=field.key, above=field.above, below=field.below,
                        at_least=field.at_least, at_most=field.at_most)  # fmt: skip
            if not node.items or kind.size[0] not in (None, len(node.items)):
                self._refuse(node)
            for item in node.items:
                self._plain(item, one)
            return None
        own = Findings()
        decode(node, field, own)
        is_text = isinstance(node, Scalar) and isinstance(to_json(node), str)
        self.found.add(f for f in own.all if f.code != "KYB105" or not is_text)
        return None

    def _text(self, node: Node, kind: ValueType, field: Field) -> Any:
        if self._judging:
            value = to_json(node) if isinstance(node, Scalar) else None
            is_title = kind != TITLE or (
                isinstance(value, str) and len(value) <= TITLE_LENGTH and NAMES["name"].match(value)
            )
            if not isinstance(value, str) or not is_title:
                self._refuse(node)
            return None
        if not isinstance(node, Scalar):
            return None
        return Unparsed(node.as_text) if kind == CONDITION else node.text

    def _any(self, node: Node, kind: AnyOf, field: Field) -> Any:
        name = "object" if isinstance(node, Mapping) else "array"
        if isinstance(node, Scalar):
            name = _JSON[type(to_json(node))]
        if self._judging and name not in kind.kinds:
            self._refuse(node)
        return node

    def _phase(self, node: Node, field: Field) -> Any:
        if self._judging:
            if isinstance(node, Mapping) and node.entries:
                for entry in node.entries.values():
                    if not is_null(entry.value):
                        self._text(entry.value, TEXT, field)
            else:
                self._text(node, TEXT, field)
        return node

    def request(self, entry: MappingEntry) -> Request | None:
        """The state that the value of a vehicle asks for; None, and a finding, for something
        else."""
        request: Request | None = self._request(entry.value, Field(key=entry.key.text))
        return request

    def _request(self, node: Node, field: Field) -> Any:
        """The state that is asked for, with the mapping of its values as its source."""
        if self._judging:
            if not (isinstance(node, Mapping) and node.entries):
                self._text(node, TEXT, field)
            return None
        if isinstance(node, Scalar):
            return Request(node.text, source=Source(node.as_text.span))
        if isinstance(node, Mapping) and len(node.entries) == 1:
            [asked] = node.entries.values()
            place = asked.key.as_text.span
            if isinstance(asked.value, Mapping):
                return Request(asked.key.text, source=Source(place, asked.value))
            if is_null(asked.value):
                return Request(asked.key.text, source=Source(place))
        message = f"`{field.key}` is asked for what is no state with its values"
        hint = f"write `{field.key}: STATE` or `{field.key}: {{STATE: {{...}}}}`"
        self.found.report("KYB244", message, node.span, help=hint)
        return None

    def _mapping(self, node: Node, kind: MappingOf, field: Field) -> Any:
        if not isinstance(node, Mapping) or len(node.entries) < field.least:
            return self._refuse(node) if self._judging else None
        values: dict[str, Any] = {}
        for name, entry in node.entries.items():
            if self._judging and not NAMES[field.names_like].match(name):
                self._refuse(node)
            if is_null(entry.value):
                continue
            one = Field(name, kind.item, key=name, names_like=field.names_like)
            value = self.value(entry.value, one, entry)
            if value is not None:
                values[name] = value
        return values if kind.as_dict else tuple(values.values())

    def _nested(self, node: Node, kind: RecordOf, field: Field, entry: MappingEntry | None) -> Any:
        if not isinstance(node, Mapping):
            if self._judging and kind.or_name:
                return self._text(node, TEXT, field)
            if not (self._judging and _is_use(kind.cls)):
                return self._refuse(node) if self._judging else None
        span = node.span if entry is None else entry.key.span
        own = (
            {}
            if entry is None or "name" not in kind.cls.__dataclass_fields__
            else {"name": field.key}
        )
        inherited = entry is not None and entry.inherited
        if self._judging or issubclass(kind.cls, Record):
            return self.record(kind.cls, node, span, inherited, **own)
        return self.parameters(kind.cls, _body(node), kind.cls.title, span)

    def _records(self, node: Node, kind: RecordOf, field: Field) -> Any:
        """A list of records; one with errors is left out."""
        if not isinstance(node, Sequence) or len(node.items) < field.least:
            return self._refuse(node) if self._judging else ()
        found = []
        for item in node.items:
            if isinstance(item, Mapping):
                found.append(self.record(kind.cls, item, item.span))
            elif self._judging:
                self._refuse(item)
        return tuple(one for one in found if one is not None)

    def _uses(self, node: Node, kind: UsesOf, field: Field) -> Any:
        """A list of parts, or of records of parts, whose names differ."""
        if not isinstance(node, Sequence):
            return self._refuse(node) if self._judging else ()
        uses: list[Any] = []
        for item in node.items:
            if self._judging and isinstance(item, Mapping) and "stack" in item.entries:
                self._judge_stack(item)
                continue
            if isinstance(kind.item, RecordOf):
                use = self.record(kind.item.cls, item, item.span)
            else:
                use = self._of(item, kind.item, field, None)
            if use is None:
                continue
            twin = next((u for u in uses if _part_in(u).alias == _part_in(use).alias), None)
            if twin is None:
                uses.append(use)
            else:
                self._twice(_part_in(twin), _part_in(use), node.span)
        return tuple(uses)

    def _judge_stack(self, item: Mapping) -> None:
        for key, entry in item.entries.items():
            if key != "stack":
                self._refuse(item)
            elif not is_null(entry.value):
                self._text(entry.value, TEXT, _TEXT_FIELD)

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

    def part(self, kind: str, node: Node, own: frozenset[str] = frozenset(), word: str = "use"):
        """The part that `node` names; `own` are the keys beside the part's parameters. A node that
        several vehicles share is decoded once."""
        return self._part(PartOf("part", False, kind, word), node, own)

    def _part(self, kind: PartOf, node: Node, own: frozenset[str]) -> PartPlan | None:
        if self._judging:
            return self._judge_part(kind, node)
        key = (kind.kind, id(node))
        if key not in self._done:
            self._done[key] = (node, self._decoded_part(kind, node, own))
        return self._done[key][1]

    def _judge_part(self, kind: PartOf, node: Node) -> None:
        if isinstance(node, Mapping):
            for word in {kind.word, "as"} if kind.word == "use" else {kind.word}:
                named = node.entries.get(word)
                may_lack = word == "as" or not kind.is_needed
                if named is not None and not (is_null(named.value) and may_lack):
                    self._text(named.value, TEXT, _TEXT_FIELD)
            if kind.word not in node.entries and kind.is_needed:
                self._refuse(node)
        elif kind.word == "use":
            self._text(node, TEXT, _TEXT_FIELD)
        else:
            self._refuse(node)

    def _decoded_part(self, kind: PartOf, node: Node, own: frozenset[str]) -> PartPlan | None:
        word, name, label = kind.word, node, None
        body = Mapping({}, node.span)
        beside = own - {word}
        if isinstance(node, Mapping):
            named = node.get(word)
            name = named if isinstance(named, Scalar) else node
            not_its = beside | ({word, "as"} if word == "use" else {word})
            kept = {k: e for k, e in node.entries.items() if k not in not_its}
            body = Mapping(kept, node.span)
            label = node.get("as") if word == "use" else None
        if not isinstance(name, Scalar):
            message = f"a part is needed, but this is {describe(node)}"
            if isinstance(node, Mapping):
                message = f"`{word}` is missing"
            self.found.report("KYB102", message, node.span, help=f"write `{word}: NAME`")
            return None
        spec = self.spec(kind.kind, name)
        if spec is None:
            return None
        params = self.parameters(spec.params, body, spec.name, name.span, beside)
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
        beside: frozenset[str] = frozenset(),
    ) -> Any:
        """The parameters of `part` as `cls`; None when they have errors. `head` is the place for
        what is missing, `beside` are keys that could be meant too."""
        fields, values, before = fields_of(cls), dict[str, Any](), len(self.found.all)
        known = {field.key: field for field in fields}
        for field in fields:
            entry = body.entries.get(field.key)
            if entry is not None and (field.required or not is_null(entry.value)):
                values[field.name] = decode(entry.value, field, self.found)
            elif field.required:
                self._missing_parameter(part, field, body, known, head)
        for key, entry in body.entries.items():
            if key not in known:
                message = f"`{key}` is no parameter of `{part}`"
                hint = meant(part, key, body, known, beside)
                self.found.report("KYB107", message, entry.key.span, help=hint)
        return None if len(self.found.all) > before else cls(**values)


_TEXT_FIELD = Field("", TEXT)


def _body(node: Node) -> Mapping:
    """`node`, or an empty mapping in its place."""
    return node if isinstance(node, Mapping) else Mapping({}, node.span)


def _may_be_called(key: str, others: ValueType | None) -> bool:
    """Whether a record whose other keys are `others` may have the key."""
    if others == EVENT_FIELD:
        return key in event_fields()
    return others is not None and (
        not isinstance(others, RecordOf) or NAMES["name"].match(key) is not None
    )


def _is_use(cls: Any) -> bool:
    """Whether the bare name of a part may stand for the record."""
    return any(isinstance(f.type, PartOf) and f.type.word == f.key == "use" for f in fields_of(cls))


def _part_in(use: Any) -> PartPlan:
    part: PartPlan = use if isinstance(use, PartPlan) else use.part
    return part


def _stands_in(node: Node, kind: ValueType) -> bool:
    """Whether `node` names what takes its place later: a parameter, or a point of the world."""
    if not isinstance(node, Scalar):
        return False
    if isinstance(kind, Numbers | Choice) or kind in (INTEGER, BOOLEAN):
        is_vector = isinstance(kind, Numbers) and kind.size == (3,)
        return bool((PLACE if is_vector else PARAMETER).match(node.text))
    return False


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
        if isinstance(value, Sequence) and depth:
            if (depth == 2) == any(isinstance(item, Sequence) for item in value.items):
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
        if kind.size:
            example = f"[{', '.join([example] * 3)}]"
        if len(kind.size) == 2:
            example = f"[{example}, ...]"
    how = f"write `{field.key}: {example}`"
    return f"{how}: {about[:1].lower()}{about[1:]}" if about else how
