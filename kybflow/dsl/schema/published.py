"""The published schema: the skeleton, and behind each place where a part is named, every part's own
schema."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kybflow.dsl.schema.building import LISTS, Schema, nullable, params_schema
from kybflow.dsl.schema.mission import skeleton

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


def mission_schema(catalog: Catalog) -> Schema:
    """The schema that editors complete from; a part's parameters follow from its name."""
    root = skeleton()
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
    one = _chosen(catalog, "sensors", several["items"])
    either = [*one["anyOf"], {"type": "array"}]
    several = {**several, "items": one, "anyOf": either, "allOf": one["allOf"]}
    sensors["additionalProperties"] = several | {"properties": one["properties"]}
    inputs = root["properties"]["inputs"]
    inputs["additionalProperties"] = _chosen(catalog, "inputs", inputs["additionalProperties"])
    _reused(root["properties"])
    faults = root["properties"]["faults"]
    faults["items"] = _chosen(catalog, "faults", faults["items"], "inject")
    actions = root["properties"]["on"]["items"]["properties"]["do"]
    actions["items"] = _actions(catalog, actions["items"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **nullable(root),
    }


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
    offered = {s.name: {**params_schema(s.fields, s.name), "description": s.summary} for s in specs}
    properties = {**action["properties"], **offered}
    return {
        **action, "properties": properties, "additionalProperties": False, "maxProperties": 1,
    }  # fmt: skip


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
            "if": {"properties": {word: {"const": name}}, "required": [word]},
            "then": _case(catalog, kind, name, {**own, word: True}),
        }
        for name in names
    ]
    bare = {"anyOf": [{"enum": names}, {"type": ["object", "null"]}]}
    more = bare if "string" in use["type"] else {}
    return {**use, "properties": {**own, word: named}, **more, "allOf": cases}


def _constant(catalog: Catalog, kind: str, name: str) -> Schema:
    return {"const": name, "description": catalog.get(kind, name).summary}


def _case(catalog: Catalog, kind: str, name: str, own: Schema) -> Schema:
    spec = catalog.get(kind, name)
    schema = params_schema(spec.fields, name)
    properties = {**dict.fromkeys(own, True), **schema["properties"]}
    return {"description": spec.summary, "properties": properties, "additionalProperties": False}
