"""The shape of `groups:` and `flows:`, and of a library's `flows:`."""

from __future__ import annotations

from kybflow.core.units import DURATION
from kybflow.dsl.schema.part_schema import Schema, quantity
from kybflow.dsl.schema.skeleton_base import NEXT, mapping, named, text


def groups_schema() -> Schema:
    """Vehicles that go by one name."""
    members: Schema = {"description": "Its vehicles.", "type": "array", "items": {"type": "string"}}
    members["examples"] = [["a", "b"]]
    return named("Vehicles that go by one name, as in `all swarm in hover`.", members)


def flows_schema() -> Schema:
    """Every flow by its name."""
    like = "Start from this flow: mappings merge, lists are replaced, null removes."
    keys: Schema = {
        "like": text(like),
        "begin": text("The first phase; without it the topmost."),
        "phases": named("Its phases: exactly one is active.", _phase(), minProperties=1),
    }
    alone = {"title": "flow", "properties": dict.fromkeys(keys, True), "required": ["phases"]}
    says = "Phases over several vehicles; a vehicle is driven by one flow at a time."
    flow = mapping("flow", says, keys, **{"if": {"required": ["like"]}, "else": alone})
    return named("What several vehicles do together, flows side by side.", flow)


def _phase() -> Schema:
    value: Schema = {"type": ["string", "number", "boolean", "array"]}
    return mapping(
        "phase",
        "What begins together, and what it goes on by. One without a way out is the last.",
        {
            "give": named("Vehicles or groups, and the flow that drives each from here on.",
                          text("The flow; it gives back when it ends.")),
            "set": {
                "description": "Options, like `swarm.processors.limit_speed.speed`, and values.",
                "type": "object", "minProperties": 1, "additionalProperties": value,
            },
            "run": named("Vehicles or groups, and the behavior that each is asked to enter.",
                         text("The behavior.")),
            "next": {
                "description": "Ways out, asked from the top in every tick; `end` ends the flow.",
                "type": "array", "items": NEXT,
            },
            "within": quantity(DURATION, "The longest that it lasts.", exclusiveMinimum=0),
            "otherwise": text("The phase to go to when it lasts longer, or `end`."),
        },
    )  # fmt: skip
