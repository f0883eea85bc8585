"""Check whether a file has the shape that the records declare, before `$name` and `like` are
resolved and parts are looked up. If it hasn't, `jsonschema` finds the errors with the schema of the
same records (ADR 22), and each becomes a finding in the words of the language."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from kybflow.core.errors import UnitError
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
    numbers,
)
from kybflow.core.text import did_you_mean, nearest
from kybflow.core.units import DIMENSIONS, article, parse_quantity
from kybflow.dsl.diagnostics import Collector, Diagnostic
from kybflow.dsl.language.records import (
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
    RecordLayout,
    UsesOf,
    layout_of,
    part_layout,
)
from kybflow.dsl.language.schema import (
    BOUNDS,
    COMPUTED,
    KINDS,
    NAMED,
    NAMES,
    PARAMETER,
    PLACE,
    TITLE_LENGTH,
    record_schema,
)
from kybflow.dsl.plan import Plan
from kybflow.dsl.reading.nodes import (
    Mapping,
    Node,
    Scalar,
    Sequence,
    describe,
    entries_of,
    head_of,
    is_null,
    shown_node,
    to_json,
)
from kybflow.dsl.reading.values import TYPES, decode_value
from kybflow.dsl.reading.yaml_errors import CONDITIONS, LACKS_COLON, missing_colon

if TYPE_CHECKING:
    from jsonschema.protocols import Validator

CODES = {
    "KYB101": "The language doesn't have this key here.",
    "KYB102": "A required key is missing.",
    "KYB103": "A value has the wrong shape, such as a list where a mapping is needed.",
    "KYB106": "A value is empty where one is required.",
    "KYB110": "A name is invalid.",
    "KYB111": "The version of the language is not supported.",
}
_JSON = {str: "string", bool: "boolean", int: "number", float: "number", type(None): "null"}
_NEVER = {("library", "kybflow"): "remove it; a library begins with `library:`"}
_MISSING = {
    "kybflow": "write `kybflow: 1`",
    "use": "write `use: NAME`",
    "phases": "write `phases: {NAME: {...}}`",
}


def judge_mission(root: Node, found: Collector) -> Mapping:
    """Check the shape of a mission and return its top level; report what is wrong. Returns an empty
    mapping if the file is not a mission."""
    if isinstance(root, Mapping) and "mission" in root.entries:
        found.add(judge_file(root, Plan))
        return root
    what = f"this is {describe(root)}" if not isinstance(root, Mapping) else "`mission` is missing"
    hint = "a mission begins with `kybflow: 1` and `mission: NAME`"
    found.report("KYB102", f"a mission is needed, but {what}", head_of(root), help=hint)
    return Mapping({}, root.span)


def is_library(root: Node) -> bool:
    """Return whether the file is a library, not a mission."""
    return isinstance(root, Mapping) and "library" in root.entries and "mission" not in root.entries


def judge_file(root: Node, kind: Any) -> list[Diagnostic]:
    """Return the findings about the shape of a whole file. kind: `Plan` or `Library`."""
    if has_shape(root, kind):
        return []
    found: list[Diagnostic] = []
    for error in _validator(kind).iter_errors(to_json(root)):
        node, name = root, ""
        for step in error.absolute_path:
            if isinstance(node, Mapping):
                node, name = node.entries[str(step)].value, str(step)
            elif isinstance(node, Sequence):
                name = name if name.endswith("]") else f"{name}[{step}]"
                node = node.items[int(step)]
        if any(isinstance(s, str) and LACKS_COLON.match(s) for s in error.absolute_path):
            continue  # the name itself is reported
        schema = error.schema if isinstance(error.schema, dict) else {}
        keyword, wanted = str(error.validator), error.validator_value
        fault = SchemaViolation(keyword, wanted, error.instance, schema, node, name)
        found += _EXPLAINERS.get(keyword, _explain_value)(fault)
    return found


def has_shape(node: Node, cls: Any) -> bool:
    """Return whether a tree has the shape of a record."""
    return _is_laid_out(node, layout_of(cls))


def _is_laid_out(node: Node, layout: RecordLayout) -> bool:
    """Return whether a tree has the keys of a layout, with values of the right types."""
    if not isinstance(node, Mapping):
        return layout.part is not None and layout.part.word == "use" and _is_text(node)
    entries, keys = node.entries, layout.keys
    if len(entries) < layout.least:
        return False
    if "like" not in entries or "like" not in keys:
        lacking = (key not in entries or is_null(entries[key].value) for key in layout.needed)
        if any(lacking):
            return False
    for key, entry in entries.items():
        field, others = keys.get(key), layout.others
        if field is None:
            if layout.part is not None:
                continue
            if others is None or (isinstance(others, RecordOf) and not NAMES["name"].match(key)):
                return False
            field = Field(type=others)
        if not (is_null(entry.value) or _fits(entry.value, field.type, field)):
            return False
    return True


def _fits(node: Node, kind: ValueType, field: Field) -> bool:
    """Return whether a value has the type `kind`. field: has the bounds of the value."""
    judge = _ALONE.get(kind) or _JUDGES[type(kind)]
    return judge(node, kind, field)


def _is_text(node: Node, *_: Any) -> TypeGuard[Scalar]:
    return isinstance(node, Scalar) and isinstance(to_json(node), str)


def _is_parameter(node: Node) -> bool:
    return isinstance(node, Scalar) and PARAMETER.match(node.text) is not None


def _is_phase(node: Node, *_: Any) -> bool:
    inside = [entry.value for entry in entries_of(node).values()]
    return _is_text(node) or (bool(inside) and all(is_null(n) or _is_text(n) for n in inside))


def _is_any_of(node: Node, kind: Any, _: Field) -> bool:
    if isinstance(node, Scalar):
        return _JSON[type(to_json(node))] in kind.kinds
    return ("object" if isinstance(node, Mapping) else "array") in kind.kinds


def _is_mapping(node: Node, kind: Any, field: Field) -> bool:
    if not isinstance(node, Mapping) or len(node.entries) < field.least:
        return False
    pattern = NAMES[field.names_like]
    return all(
        pattern.match(name) and (is_null(entry.value) or _fits(entry.value, kind.item, field))
        for name, entry in node.entries.items()
    )


def _is_list(node: Node, kind: Any, field: Field) -> bool:
    if not isinstance(node, Sequence) or len(node.items) < field.least:
        return False
    return all(_fits(item, kind.item, field) for item in node.items)


def _is_sensors(node: Node, kind: Any, field: Field) -> bool:
    if isinstance(node, Sequence):
        return bool(node.items) and _is_list(node, kind, field)
    return _fits(node, kind.item, field)


def _are_uses(node: Node, kind: Any, field: Field) -> bool:
    """Return whether each item is a use of a part, or only a stack."""
    if not isinstance(node, Sequence):
        return False
    for item in node.items:
        if isinstance(item, Mapping) and "stack" in item.entries:
            stack = item.entries["stack"].value
            if len(item.entries) > 1 or not (is_null(stack) or _is_text(stack)):
                return False
        elif not _fits(item, kind.item, field):
            return False
    return True


def _are_sized(node: Node, kind: Numbers, size: tuple[int | None, ...], field: Field) -> bool:
    if isinstance(node, Scalar):
        is_place = size == (3,) and field.shape != "matrix"
        if (PLACE if is_place else PARAMETER if size else COMPUTED).match(node.text):
            return True
        return not size and _is_quantity(node, kind, field)
    if not size or not isinstance(node, Sequence) or not node.items:
        return False
    if size[0] not in (None, len(node.items)):
        return False
    return all(_are_sized(item, kind, size[1:], field) for item in node.items)


def _is_quantity(node: Scalar, kind: Numbers, field: Field) -> bool:
    """Return whether the node is a quantity. The bounds are checked only for a number without a
    unit."""
    if is_null(node) or isinstance(value := to_json(node), bool):
        return False
    try:
        number = parse_quantity(node.text, kind.dimension)
    except UnitError:
        return False
    return isinstance(value, str) or field.is_within(number)


def _is_whole(node: Node, _: Any, field: Field) -> bool:
    value = to_json(node)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return isinstance(node, Scalar) and COMPUTED.match(node.text) is not None
    return value == int(value) and field.is_within(value)


_Judge = Callable[[Node, Any, Field], bool]
_ALONE: dict[ValueType, _Judge] = {
    TEXT: _is_text, CONDITION: _is_text, EVENT: _is_text, STATE: _is_text, FILE: _is_text,
    FILE_PATH: _is_text,
    TITLE: lambda node, *_: _is_text(node) and len(node.text) <= TITLE_LENGTH
    and NAMES["name"].match(node.text) is not None,
    PHASE: _is_phase, SENSORS: _is_sensors,
    VERSION: lambda node, *_: (value := to_json(node)) == 1 and not isinstance(value, bool),
    REQUEST: lambda node, *_: bool(entries_of(node)) or _is_text(node),
    INTEGER: _is_whole,
    BOOLEAN: lambda node, *_: isinstance(to_json(node), bool) or _is_parameter(node),
}  # fmt: skip
_JUDGES: dict[type[ValueType], _Judge] = {
    Numbers: lambda node, kind, field: _are_sized(node, kind, kind.size, field),
    Choice: lambda node, kind, _: _is_text(node) and (
        node.text in kind.words or _is_parameter(node)
    ),
    ListOf: _is_list, MappingOf: _is_mapping,
    RecordOf: lambda node, kind, _: (kind.or_name and _is_text(node)) or has_shape(node, kind.cls),
    PartOf: lambda node, kind, _: _is_laid_out(node, part_layout(kind)),
    UsesOf: _are_uses, AnyOf: _is_any_of,
}  # fmt: skip
"""The function that checks a value of each type."""


class SchemaViolation(NamedTuple):
    """One error of `jsonschema`. keyword, wanted: the keyword that failed and its value. instance:
    the invalid value. schema: the schema that contains the keyword. node: the node at which the
    error occurred. name: the author's word for that node."""

    keyword: str
    wanted: Any
    instance: Any
    schema: dict[str, Any]
    node: Node
    name: str


@functools.cache
def _validator(kind: Any) -> Validator:
    from jsonschema import Draft202012Validator  # slower to import than the rest of `dsl`

    return Draft202012Validator(record_schema(kind))


def _explain_unknown(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    assert isinstance(node, Mapping)
    known = fault.schema["properties"]
    for key, entry in node.entries.items():
        if key not in known:
            what = fault.schema["title"]
            hint = _NEVER.get((what, key)) or did_you_mean(key, known)
            message = f"`{key}` is not a key of {article(what)}"
            yield Diagnostic("KYB101", message, entry.key.span, help=hint)


def _explain_missing(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    assert isinstance(node, Mapping)
    is_closed = fault.schema.get("additionalProperties") is False
    unknown = [k for k in node.entries if is_closed and k not in fault.schema["properties"]]
    for key in fault.wanted:
        if node.get(key) is not None or nearest(key, unknown):
            continue  # the misspelt key is reported already
        what, hint = fault.schema["title"], _MISSING.get(key, "")
        known = fault.schema["properties"].get(key)
        if not hint and isinstance(known, dict) and "description" in known:
            about = known["description"].partition(". ")[0].removesuffix(".")
            hint = f"write `{key}: ...`: {about[:1].lower()}{about[1:]}"
        others = [k for k in node.entries if k not in fault.schema["properties"]]
        near = [k for k in ("use", "stack") if nearest(k, others)]
        if key == "use" and near and near[0] in fault.schema["properties"]:
            hint = f"did you mean `{near[0]}`?"
        yield Diagnostic("KYB102", f"{article(what)} needs `{key}`", head_of(node), help=hint)


def _explain_version(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    shown = node.text if isinstance(node, Scalar) else describe(node)
    message = f"version `{shown}` of the mission language is not supported"
    if isinstance(node, Scalar) and node.quoted and node.text.strip() == "1":
        message = "the version is a number, but its quotes make it a text"
    yield Diagnostic("KYB111", message, node.span, help="write `kybflow: 1`")


def _explain_few(fault: SchemaViolation) -> Iterator[Diagnostic]:
    if fault.wanted != 1:
        yield from _explain_value(fault)
        return
    is_list = fault.keyword == "minItems"
    examples = fault.schema.get("examples", [{"NAME": "{...}"}])
    hint = f"write at least one entry: `{fault.name}: {_flow(examples[0])}`"
    if is_list:
        hint = f"name at least one, or leave out `{fault.name}`"
    yield Diagnostic("KYB106", f"`{fault.name}` is empty", fault.node.span, help=hint)


def _explain_name(fault: SchemaViolation) -> Iterator[Diagnostic]:
    """Explain an invalid name in a mapping, or an invalid title of a file; explain any other text
    as a value."""
    most, name = fault.schema.get("maxLength"), str(fault.instance)
    if isinstance(fault.node, Mapping) and fault.keyword == "pattern":
        span = fault.node.entries[name].key.span
        hint = NAMED
        if cut := LACKS_COLON.match(name):
            message, rest = f"a colon is missing after `{cut[1]}`", name[cut.end() - 1 :]
            yield Diagnostic("KYB014", message, span, help=f"write `{cut[1]}: {rest}: ...`")
            return
        if _WORDS.fullmatch(name):
            hint = f"write `{re.sub('[- ]', '_', name)}`: {hint}"
        yield Diagnostic("KYB110", f"`{name}` can't be a name", span, help=hint)
    elif most is not None:
        message = f"`{repr(name[:most])[1:-1]}` can't be the name of a {fault.name}"
        yield Diagnostic("KYB110", message, fault.node.span, help=_rule_of_names(most))
    else:
        yield from _explain_value(fault)


_WORDS = re.compile(r"[A-Za-z]\w*([- ]\w+)+", re.ASCII)
"""Words that would be a name if they were joined with `_`."""


def _rule_of_names(most: int) -> str:
    return f"{NAMED.replace(', and', ',')}, and may have at most {most} characters"


def _explain_value(fault: SchemaViolation) -> Iterator[Diagnostic]:
    """Explain a wrong type, pattern, bound or choice, with the decoder's message if it has one."""
    node, name = fault.node, fault.name
    schema = fault.schema
    field = _field(name, schema)
    found = Collector()
    if field is not None:
        decode_value(node, field, found)
    if found.all:
        yield from found.all
        return
    types = fault.wanted if fault.keyword == "type" else schema.get("type", ())
    types = [types] if isinstance(types, str) else [t for t in types if t != "null"]
    if len(types) > 1 and "\\$" in schema.get("pattern", ""):
        types.remove("string")
    wanted = " or ".join(dict.fromkeys(KINDS[t] for t in types)) or "another value"
    place = f"`{name}`" if name else f"{article(schema.get('title', 'file'))}"
    yield Diagnostic(
        "KYB103",
        f"{place} must be {wanted}, but this is {shown_node(node)}",
        node.span,
        help=_way_out(fault, types),
    )


def _way_out(fault: SchemaViolation, types: list[str]) -> str:
    """Return the hint how to write a value of one of `types`, or an empty string if none is
    known."""
    node, name, schema = fault.node, fault.name, fault.schema
    own = name.rpartition("[")[0] or name
    if name in CONDITIONS:
        return "write a condition, like `state.altitude > 1 m`"
    if name == "log" and isinstance(node, Mapping):
        return "if it is a text, write it in quotes: braces mean a mapping"
    if isinstance(node, Scalar):
        if "object" in types and missing_colon(node.text):
            return missing_colon(node.text)
        if "array" in types and node.text.startswith("-"):
            return "a list has a space after each `-`"
        if list(dict.fromkeys(types)) == ["string"] and not node.is_null:
            most, quoted = schema.get("maxLength"), f'"{node.text[:60]}" in quotes'
            return _rule_of_names(most) if most else f"write {quoted} if you mean the text"
    if schema.get("examples") and fault.keyword == "type":
        if schema.get("title") == "parameter" and isinstance(node, Scalar) and node.text in TYPES:
            return f"write `{own}: {{type: {node.text}}}`"
        return f"write it like `{own}: {_flow(schema['examples'][0])}`"
    return _reshaped(node, types, own)


def _reshaped(node: Node, types: list[str], name: str) -> str:
    """Return a hint for a list that should be a mapping, or a mapping or text that should be a
    list; empty if neither applies."""
    if types == ["array"] and isinstance(node, Scalar) and node.text:
        return "write it as a list: each item on its own line, after `- `"
    if isinstance(node, Sequence) and "array" not in types and "string" in types and node.items:
        first = node.items[0]
        one = f"`{name}: {first.text}`" if isinstance(first, Scalar) else "it without the brackets"
        others = "; the next behavior is a state of its own, which `then` names"
        one = f"one: {one}" if isinstance(first, Scalar) else one
        return f"write {one}{others if name == 'do' else ''}"
    if isinstance(node, Scalar) and node.is_null and types == ["object"]:
        return f"write `{name}: {{NAME: {{...}}}}`"
    if name and types == ["object"] and isinstance(node, Sequence):
        return f"write it in braces: `{name}: {{...}}`"
    is_mapping = name and types == ["array"] and isinstance(node, Mapping)
    return f"write it in brackets: `{name}: [{{...}}]`" if is_mapping else ""


def _field(name: str, schema: dict[str, Any]) -> Field | None:
    """Return a field with the parts of the schema that the decoder needs, or None if the decoder
    can't decode such a value."""
    bounds: Any = {ours: schema[theirs] for theirs, ours in BOUNDS.items() if theirs in schema}
    dimension = DIMENSIONS.get(schema.get("x-dimension", ""))
    if dimension is not None:
        kind = numbers(dimension, "vector" if "items" in schema else "scalar")
        return Field(name=name, type=kind, key=name, **bounds)
    choices = tuple(schema.get("anyOf", [{}])[0].get("enum", ()))
    if choices:
        return Field(name=name, type=Choice("choice", False, choices), key=name)
    if bounds and "integer" in schema.get("type", ()):
        return Field(name=name, type=INTEGER, key=name, **bounds)
    return None


def _flow(value: Any) -> str:
    """Return an example as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(inner)}" for key, inner in value.items()) + "}"
    return "[" + ", ".join(map(_flow, value)) + "]" if isinstance(value, list) else str(value)


_EXPLAINERS = {
    "additionalProperties": _explain_unknown,
    "required": _explain_missing,
    "const": _explain_version,
    "minProperties": _explain_few,
    "minItems": _explain_few,
    "pattern": _explain_name,
    "maxLength": _explain_name,
}
