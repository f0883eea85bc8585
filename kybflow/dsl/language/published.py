"""The published schema: the skeleton, and behind each place where a part is named, every part's own
schema."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kybflow.dsl.language.editor import for_editors, parameter
from kybflow.dsl.language.schema import Schema, params_schema, record_schema
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import END, LISTS, Plan
from kybflow.parts.events import RUN_EVENTS, VEHICLE_EVENTS

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog, PartSpec


def mission_schema(catalog: Catalog) -> Schema:
    """The schema that editors complete from; a part's parameters follow from its name."""
    root: Schema = json.loads(json.dumps(record_schema(Plan)))  # nothing in it is shared
    vehicle = root["properties"]["vehicles"]["additionalProperties"]["properties"]
    for kind in LISTS:
        vehicle[kind]["items"] = _chosen(catalog, kind, vehicle[kind]["items"])
    vehicle["tracker"] = _chosen(catalog, "trackers", vehicle["tracker"])
    vehicle["behaviors"]["additionalProperties"] = _chosen(
        catalog, "behaviors", vehicle["behaviors"]["additionalProperties"], "do"
    )
    target = root["properties"]["targets"]["additionalProperties"]["additionalProperties"]
    target["properties"]["driver"] = _chosen(catalog, "drivers", target["properties"]["driver"])
    sensors = target["properties"]["sensors"]
    several = sensors["additionalProperties"]
    root["$defs"] = {"sensor": _chosen(catalog, "sensors", several["items"])}
    one = {"$ref": "#/$defs/sensor"}
    sensors["additionalProperties"] = {
        "description": several["description"], "type": several["type"], "items": one,
        "minItems": 1, "if": {"type": ["array", "null"]}, "else": one,
    }  # fmt: skip
    inputs = root["properties"]["inputs"]
    inputs["additionalProperties"] = _chosen(catalog, "inputs", inputs["additionalProperties"])
    _suggest(catalog, root["properties"])
    _reused(root["properties"])
    faults = root["properties"]["faults"]
    faults["items"] = _chosen(catalog, "faults", faults["items"], "inject")
    actions = root["properties"]["on"]["items"]["properties"]["do"]
    actions["items"] = _actions(catalog, actions["items"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **for_editors(root),
    }


def _suggest(catalog: Catalog, properties: Schema) -> None:
    """Give the keys whose values are names or conditions some that every mission may have."""
    events = sorted(VEHICLE_EVENTS | _emitted_by_parts(catalog))
    states = [name for name in BUILT_IN if name != "fault"]
    state = properties["vehicles"]["additionalProperties"]["properties"]["behaviors"]
    _offer(state["additionalProperties"], {
        "then": states, "failed": states, "within": ["10 s"], "go": states, "after": ["10 s"],
        "when": ["battery.remaining < 30 %", "state.altitude > 1 m", "elapsed > 5 s"],
        "event": ["operator.go", *events],
    })  # fmt: skip
    of_any = ["operator.go", *sorted(RUN_EVENTS), *(f"any.{name}" for name in events)]
    flow = properties["flows"]["additionalProperties"]
    in_a_phase = {
        "when": ["all swarm in hover", "a in landed"], "event": of_any, "go": [END],
        "after": ["10 s"], "within": ["20 s"], "otherwise": [END],
    }  # fmt: skip
    _offer(flow, in_a_phase)
    _offer(flow["properties"]["phases"]["additionalProperties"], in_a_phase)
    when = ["any swarm in fault", "a.battery.remaining < 30 %"]
    _offer(properties["on"]["items"], {"event": of_any, "when": when})


def _emitted_by_parts(catalog: Catalog) -> set[str]:
    kinds = ("behaviors", "processors", "supervisors")
    specs = (catalog.get(kind, name) for kind in kinds for name in catalog.names(kind))
    return {event for spec in specs for event in spec.cls.events}


def _offer(mapping: Schema, examples: dict[str, list[str]]) -> None:
    """Give the keys of a mapping and of its `next` their examples."""
    for key, value in mapping["properties"].items():
        if key == "next":
            _offer(value["items"], examples)
        elif key in examples:
            value["examples"] = examples[key]


def schema_text(catalog: Catalog) -> str:
    """The published schema as it is committed."""
    return json.dumps(mission_schema(catalog), indent=1, ensure_ascii=False) + "\n"


def _reused(properties: Schema) -> None:
    """Let chains, stacks and targets complete as vehicles do."""
    vehicle = "#/properties/vehicles/additionalProperties/properties"
    chain = properties["chains"]["additionalProperties"]["properties"]
    chain["behaviors"]["additionalProperties"] = {
        "$ref": f"{vehicle}/behaviors/additionalProperties"
    }
    stack = properties["stacks"]["additionalProperties"]["properties"]
    for kind in LISTS:
        stack[kind]["items"] = {"$ref": f"{vehicle}/{kind}/items"}
    target = properties["targets"]["additionalProperties"]["additionalProperties"]
    target["properties"]["tracker"] = {"$ref": f"{vehicle}/tracker"}
    inputs = properties["targets"]["additionalProperties"]["properties"]["inputs"]
    inputs["additionalProperties"] = {"$ref": "#/properties/inputs/additionalProperties"}


def _actions(catalog: Catalog, action: Schema) -> Schema:
    """`action`, with those of packages, and no other."""
    specs = [catalog.get("actions", name) for name in catalog.names("actions")]
    properties = {**action["properties"], **{s.name: _action(s) for s in specs}}
    return {
        **action, "properties": properties, "additionalProperties": False, "maxProperties": 1,
    }  # fmt: skip


def _action(spec: PartSpec) -> Schema:
    whole = params_schema(spec.fields, spec.name)
    properties = {field.name: parameter(field) for field in spec.fields}
    return {**whole, "description": spec.summary, "properties": properties}


def _chosen(catalog: Catalog, kind: str, use: Schema, word: str = "use") -> Schema:
    """`use`, with the part's parameters once its name is written."""
    names = list(catalog.names(kind))
    own = use["properties"]
    choices = [_constant(catalog, kind, name) for name in names]
    if word == "do":
        choices.append({"pattern": r"^chain\.", "description": "A chain, with its parameters."})
    named = {**own[word], "anyOf": choices}
    cases: list[Schema] = [
        {
            "if": {"properties": {word: _written(name)}, "required": [word]},
            "then": _case(catalog, kind, name, {**own, word: True}),
        }
        for name in names
    ]
    bare = {"anyOf": [{"enum": names}, {"not": {"type": "string"}}]}
    more = bare if "string" in use["type"] else {}
    return {**use, "properties": {**own, word: named}, **more, "allOf": cases}


def _written(name: str) -> Schema:
    """The name and no other. A language server takes the beginning of a constant for the whole
    while it completes, `follow` for `follow_path`; a pattern it takes as it stands."""
    return {"const": name, "pattern": f"^{name}$"}


def _constant(catalog: Catalog, kind: str, name: str) -> Schema:
    return {"const": name, "description": catalog.get(kind, name).summary}


def _case(catalog: Catalog, kind: str, name: str, own: Schema) -> Schema:
    spec = catalog.get(kind, name)
    properties = {**dict.fromkeys(own, True), **{f.name: parameter(f) for f in spec.fields}}
    return {"description": spec.summary, "properties": properties, "additionalProperties": False}
