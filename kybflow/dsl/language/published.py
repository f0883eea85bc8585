"""The published schema, which editors use for completion: every record of the language, and a
part's parameters after the part's name.

A language server offers `null` wherever a `type` allows it, and inserts a list wherever it finds
`items`. The constraints of a value are therefore inside an `if`, which the server uses to validate
but not to complete. `null` is valid there: it removes what `like` brought.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from kybflow.core.params import Field, ListOf, Numbers, RecordOf
from kybflow.core.units import DIMENSIONS
from kybflow.dsl.language.records import SENSORS, PartOf, layout_of
from kybflow.dsl.language.schema import BOUNDS, KINDS, Schema, Schemas, numbers_schema, snippets
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import END, ActionKeys, CallbackPlan, FlowPlan, PhasePlan, Plan, StatePlan
from kybflow.parts.events import RUN_EVENTS, VEHICLE_EVENTS

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

_SHOWN = ("title", "description", "examples", "defaultSnippets")
_NOTHING: Schema = {"type": "null"}
_ANY_NAME: Schema = {"defaultSnippets": [{"label": "NAME", "body": "\n  ${1:name}: "}]}


def schema_text(catalog: Catalog) -> str:
    """Return the published schema as it is committed, in JSON."""
    return json.dumps(mission_schema(catalog), indent=1, ensure_ascii=False) + "\n"


def mission_schema(catalog: Catalog) -> Schema:
    """Return the schema that editors use for completion. The parameters of a part depend on its
    name."""
    editor = Editor(catalog)
    root = editor.schemas.record(Plan)
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, **root, "$defs": dict(sorted(editor.shared.items()))}


class Editor:
    """Completes the schemas of records and values for editors. shared: the schemas of each kind of
    part and of each dimension, to which the other schemas refer."""

    def __init__(self, catalog: Catalog) -> None:
        self.schemas = Schemas(self._finished)
        self.shared: Schema = {}
        self._catalog = catalog
        kinds = ("behaviors", "processors", "supervisors")
        specs = (catalog.get(kind, name) for kind in kinds for name in catalog.names(kind))
        events = sorted(VEHICLE_EVENTS | {event for spec in specs for event in spec.cls.events})
        states = [name for name in BUILT_IN if name != "fault"]
        of_any = ["operator.go", *sorted(RUN_EVENTS), *(f"any.{name}" for name in events)]
        in_a_phase = {
            "when": ["all swarm in hover", "a in landed"], "event": of_any, "go": [END],
            "after": ["10 s"], "within": ["20 s"], "otherwise": [END],
        }  # fmt: skip
        self._offered: dict[Any, dict[str, list[str]]] = {
            StatePlan: {
                "then": states, "failed": states, "within": ["10 s"], "go": states,
                "after": ["10 s"], "event": ["operator.go", *events],
                "when": ["battery.remaining < 30 %", "state.altitude > 1 m", "elapsed > 5 s"],
            },
            FlowPlan: in_a_phase,
            PhasePlan: in_a_phase,
            CallbackPlan: {
                "event": of_any, "when": ["any swarm in fault", "a.battery.remaining < 30 %"]
            },
        }  # fmt: skip
        """Values that every mission may have, for keys of records and of their `next`."""

    def _finished(self, schema: Schema, field: Field, may_lack: bool) -> Schema:
        """Return the schema as editors need it, with the parameters of parts and with values to
        insert."""
        kind = field.type
        cls = kind.cls if isinstance(kind, RecordOf) else None
        part = kind if isinstance(kind, PartOf) else layout_of(cls).part if cls else None
        if cls in self._offered:
            _offer(schema["properties"], self._offered[cls])
        if cls is ActionKeys:
            for name in self._catalog.names("actions"):
                spec = self._catalog.get("actions", name)
                params: Any = spec.params
                one = self.schemas.mapping(layout_of(params), name, spec.summary)
                schema["properties"][name] = one
            schema = {**schema, "additionalProperties": False, "maxProperties": 1}
        if kind is SENSORS:
            one = schema["items"]
            kept = {key: schema[key] for key in ("description", "items", "minItems")}
            return {**kept, "if": {"type": ["array", "null"]}, "else": one}
        if "type" not in schema:
            return schema
        if part is None:
            return self._apart(schema, field, may_lack)
        whole = self._apart({**schema, **self._chosen(part, schema)}, field, may_lack)
        about = whole.pop("description")
        self.shared[part.kind] = whole
        return {"description": about, "$ref": f"#/$defs/{part.kind}"}

    def _apart(self, schema: Schema, field: Field, may_lack: bool) -> Schema:
        """Return the schema with the constraints of a value separated from what an editor shows and
        inserts."""
        kind, types = field.type, schema["type"]
        types = [types] if isinstance(types, str) else types
        needed = " or ".join(KINDS[one] for one in types).capitalize() + " is needed."
        right = {"type": schema["type"], "errorMessage": needed}
        of_mappings = isinstance(kind, ListOf) and isinstance(kind.item, RecordOf | PartOf)
        if "object" in types or of_mappings:
            shown = {key: one for key, one in schema.items() if key != "type"}
            right = right if may_lack else {"type": schema["type"]}
            if types == ["object"] and not shown.keys() & {"properties", "examples"}:
                shown |= _ANY_NAME
        else:
            shown = {key: one for key, one in schema.items() if key in _SHOWN}
            right |= {key: one for key, one in schema.items() if key not in _SHOWN}
            if isinstance(kind, Numbers):
                right = self._shared(right)
            if not shown.keys() & {"examples", "defaultSnippets"}:
                shown["anyOf"] = [{}]  # a value of no type: the key is inserted, and none with it
        return {**shown, "if": _NOTHING, "else": right} if may_lack else {**shown, **right}

    def _shared(self, numbers: Schema) -> Schema:
        """Return the schema of numbers with a reference to the shared schema of their dimension."""
        if "items" in numbers:
            return {**numbers, "items": self._shared(numbers["items"])}
        dimension = DIMENSIONS[numbers["x-dimension"]]
        name = dimension.name.replace(" ", "_")
        self.shared.setdefault(name, numbers_schema(dimension, (), Field()))
        bounds = {key: numbers[key] for key in BOUNDS if key in numbers}
        return {"$ref": f"#/$defs/{name}", **bounds}

    def _chosen(self, part: PartOf, schema: Schema) -> Schema:
        """Return the schema of a part: the valid names, and for each name its parameters."""
        word, own = part.word, schema["properties"]
        specs = {
            name: self._catalog.get(part.kind, name) for name in self._catalog.names(part.kind)
        }
        choices: list[Schema] = [
            {"const": name, "description": spec.summary} for name, spec in specs.items()
        ]
        if word == "do":
            choices.append({"pattern": r"^chain\.", "description": "A chain, with its parameters."})
        about = own[word]["description"]
        named = {**own, word: {"description": about, "type": "string", "anyOf": choices}}
        cases = [*schema.get("allOf", ())]
        for name, spec in specs.items():
            # completing, a language server accepts the beginning of a constant in place of the
            # whole, such as `follow` for `follow_path`, but it matches a pattern exactly
            written = {"properties": {word: {"const": name, "pattern": f"^{name}$"}}}
            properties = {**dict.fromkeys(own, True), **self.schemas.properties(spec.fields)}
            then = {
                "description": spec.summary, "properties": properties, "additionalProperties": False
            }  # fmt: skip
            cases.append({"if": {**written, "required": [word]}, "then": then})
        whole = {"properties": named, "allOf": cases}
        bare = {"anyOf": [{"enum": list(specs)}, {"not": {"type": "string"}}]}
        return {**whole, **bare} if "string" in schema["type"] else whole


def _offer(properties: Schema, texts: dict[str, list[str]]) -> None:
    """Add values to insert to the keys of a mapping and of its `next`."""
    for key, value in properties.items():
        if key == "next":
            _offer(value["items"]["properties"], texts)
        elif key in texts:
            value.pop("anyOf", None)
            value["defaultSnippets"] = snippets(texts[key])
