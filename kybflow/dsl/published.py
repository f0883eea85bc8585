"""The published schema: the skeleton, and behind each place where a part is named, every part's own
schema."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kybflow.dsl.schema import Schema, nullable, params_schema
from kybflow.dsl.skeleton import skeleton

if TYPE_CHECKING:
    from kybflow.catalog import Catalog

_LISTS = ("estimators", "processors", "supervisors")


def mission_schema(catalog: Catalog) -> Schema:
    """The schema that editors complete from; a part's parameters follow from its name."""
    root = skeleton()
    vehicle = root["properties"]["vehicles"]["additionalProperties"]["properties"]
    for kind in _LISTS:
        vehicle[kind]["items"] = _chosen(catalog, kind, vehicle[kind]["items"])
    vehicle["tracker"] = _chosen(catalog, "trackers", vehicle["tracker"])
    vehicle["behaviors"]["additionalProperties"] = _chosen(
        catalog, "behaviors", vehicle["behaviors"]["additionalProperties"], "do"
    )
    target = root["properties"]["targets"]["additionalProperties"]["additionalProperties"]
    target["properties"]["driver"] = _chosen(catalog, "drivers", target["properties"]["driver"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **nullable(root),
    }


def schema_text(catalog: Catalog) -> str:
    """The published schema as it is committed."""
    return json.dumps(mission_schema(catalog), indent=1, ensure_ascii=False) + "\n"


def _chosen(catalog: Catalog, kind: str, use: Schema, word: str = "use") -> Schema:
    """`use`, with the part's parameters once its name is written."""
    names = list(catalog.names(kind))
    own = use["properties"]
    named = {**own[word], "anyOf": [_constant(catalog, kind, name) for name in names]}
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
