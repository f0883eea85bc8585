"""The shape of `on:`, and no action of a package."""

from __future__ import annotations

from kybflow.dsl.schema.part_schema import Schema
from kybflow.dsl.schema.skeleton_base import text
from kybflow.parts.observables import EVENT_FIELDS

_SCALAR = ["string", "number", "boolean"]
_OWN = {
    "event": (
        "What to hear: `VEHICLE.NAME`, `any.NAME` of every vehicle, `operator.NAME` of a person, "
        "or the bare name of an event of the run, or of one that a mission emits."
    ),
    "when": "A condition that must hold too, like `a in landed`; vehicles go by their names.",
}


def _names(help: str, value: Schema) -> Schema:
    return {
        "description": help, "type": "object", "minProperties": 1, "additionalProperties": value,
    }  # fmt: skip


def action_schema() -> Schema:
    """One action: a mapping with one key. Those of packages have any other key, and their
    parameters."""
    value: Schema = {"type": [*_SCALAR, "array"]}
    return {
        "title": "action",
        "description": "What to do: one action.",
        "type": "object",
        "examples": [[{"log": "hello"}, {"stop": "enough"}]],
        "minProperties": 1,
        "properties": {
            "switch": _names(
                "Vehicles or groups, and the state that each is asked to enter.",
                text("The state."),
            ),
            "set": _names(
                "Options, like `a.processors.limit_speed.speed`, and their new values.", value
            ),
            "enable": text("A processor to use again, like `a.processors.limit_speed`."),
            "disable": text("A processor to leave out; none that is a safety part."),
            "emit": text("An event of the mission's own, to be heard in the next tick."),
            "phase": {
                "description": "A phase to enter; `{FLOW: PHASE}` where several flows have it.",
                "type": ["string", "object"],
                "minProperties": 1,
                "additionalProperties": text("The phase."),
            },
            "log": text("A text for the record, with `{vehicle}`, `{time}` and the event's own."),
            "stop": text("Why the run ends here: every vehicle lands."),
        },
        "additionalProperties": {"type": ["object", "null", *_SCALAR, "array"]},
    }


def on_schema() -> Schema:
    """The list of callbacks. A callback's other keys are fields of its event."""
    fields = sorted({name for names in EVENT_FIELDS.values() for name in names})
    return {
        "description": "What is done when something happens, at any time.",
        "type": "array",
        "items": {
            "title": "callback",
            "description": "An event, and the actions that it brings about, in this order.",
            "type": "object",
            "properties": {
                **{key: text(what) for key, what in _OWN.items()},
                "do": {
                    "description": "The actions, each a mapping with one key.",
                    "type": "array",
                    "items": action_schema(),
                    "examples": [[{"log": "hello"}, {"stop": "enough"}]],
                },
                **{
                    name: {"description": f"Only when the event's `{name}` is this.",
                           "type": _SCALAR}
                    for name in fields
                },
            },
            "required": ["event", "do"],
            "additionalProperties": False,
        },
    }  # fmt: skip
