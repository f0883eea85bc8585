"""The shape of the language: every key of a mission and of a library, and no part."""

from __future__ import annotations

from typing import Any

from kybflow.dsl.parameters import TYPES
from kybflow.dsl.schema import Schema, params_schema, quantity, vector
from kybflow.params import fields_of
from kybflow.site import Airframe
from kybflow.units import ANGLE, DURATION, FREQUENCY, LENGTH

_NAME = r"^[A-Za-z_][A-Za-z0-9_]*(?!\n)$"
"""Python's `$` alone would let a line break end the name."""


def _title() -> Schema:
    """The name of a file's content; a run's folder is called by it."""
    return {"description": "Its name.", "type": "string", "pattern": _NAME, "maxLength": 60}


def _text(help: str) -> Schema:
    return {"description": help, "type": "string"}


def _named(help: str, value: Schema, **more: Any) -> Schema:
    """A mapping of names to `value`."""
    names = {"pattern": _NAME}
    return {
        "description": help, "type": "object", "propertyNames": names,
        "additionalProperties": value, **more,
    }  # fmt: skip


def _mapping(title: str, help: str, properties: Schema, **more: Any) -> Schema:
    return {
        "title": title, "description": help, "type": "object", "properties": properties,
        "additionalProperties": False, **more,
    }  # fmt: skip


def _use(title: str, help: str, extra: Schema | None = None) -> Schema:
    """A part by its bare name, or a mapping with `use` and its parameters."""
    properties = {
        "use": _text("Name of the part."),
        "as": _text("A name of its own, when the same part is used twice."),
        **(extra or {}),
    }
    return {
        "title": title, "description": help, "type": ["string", "object"],
        "properties": properties, "required": ["use"],
    }  # fmt: skip


def _uses(title: str, help: str, extra: Schema | None = None) -> Schema:
    return {"description": help, "type": "array", "items": _use(title, "One of them.", extra)}


NEXT = _mapping(
    "transition",
    "One way out of a behavior: all of `when`, `event` and `after` that are written must hold.",
    {
        "when": _text("A condition, like `state.altitude > 1 m`."),
        "event": _text("An event to hear."),
        "after": quantity(DURATION, "Time in the behavior.", minimum=0),
        "for": quantity(DURATION, "How long the condition must hold.", minimum=0),
        "go": _text("The behavior to go to."),
    },
    required=["go"],
)
STATE: Schema = {
    "title": "behavior",
    "description": "One state: what the vehicle does, and where it goes from there.",
    "type": "object",
    "properties": {
        "do": _text("The behavior to fly; its parameters are keys beside it."),
        "then": _text("Where to go when it is done."),
        "next": {
            "description": "Ways out, asked from the top in every tick.",
            "type": "array",
            "items": NEXT,
        },
        "failed": _text("Where to go when it fails."),
        "within": quantity(DURATION, "It fails when it takes longer.", exclusiveMinimum=0),
    },
}
ESTIMATOR_KEYS: Schema = {
    "healthy": _text("A condition: the estimate may be used, like `age < 100 ms`."),
    "recover_after": quantity(DURATION, "Healthy so long before it is used again.", minimum=0),
    "for_at_most": quantity(DURATION, "Use it no longer than this.", exclusiveMinimum=0),
}
START = _mapping(
    "start",
    "Where the vehicle stands before take-off.",
    {
        "at": vector(LENGTH, "Position, world frame (ENU)."),
        "heading": quantity(ANGLE, "Angle of the nose from east, counter-clockwise."),
    },
)


def _airframe() -> Schema:
    schema = params_schema(fields_of(Airframe), "airframe")
    return {
        **schema,
        "required": [],
        "properties": {"like": _text("Start from this airframe."), **schema["properties"]},
    }


def _vehicle() -> Schema:
    airframe = {**_airframe(), "type": ["string", "object"]}
    return _mapping(
        "vehicle",
        "What flies, what it trusts, what it does.",
        {
            "like": _text(
                "Start from this vehicle: mappings merge, lists are replaced, null removes."
            ),
            "airframe": {**airframe, "description": "Name of an airframe, or its numbers."},
            "start": START,
            "estimators": _uses("estimator", "The first healthy one is used.", ESTIMATOR_KEYS),
            "processors": _uses("processor", "What may bend the setpoint, in this order."),
            "tracker": _use("tracker", "What turns the setpoint into a command."),
            "supervisors": _uses("supervisor", "What watches a bound."),
            "begin": _text("The first behavior; without it the topmost."),
            "behaviors": _named("The vehicle's state machine: exactly one is active.", STATE),
        },
    )  # fmt: skip


def _parameter() -> Schema:
    value: Schema = {"type": ["number", "string", "boolean", "array"]}
    return _mapping(
        "parameter",
        "A value that `--set` may change; `$name` stands for it.",
        {
            "type": {**_text("What kind of value."), "examples": list(TYPES)},
            "default": {"description": "The value when nothing sets it.", **value},
            **{bound: {"description": "A bound.", "type": ["number", "string"]}
               for bound in ("above", "at_least", "below", "at_most")},
            "help": _text("What it is."),
        },
        required=["type"],
    )  # fmt: skip


def _import() -> Schema:
    return {
        "title": "import",
        "type": ["string", "object"],
        "properties": {"from": _text("The library's file."), "with": {"type": "object"}},
        "required": ["from"],
        "additionalProperties": False,
    }


def _shared() -> Schema:
    return {
        "summary": _text("One line for people."),
        "import": _named("Libraries, each under a name.", _import()),
        "parameters": _named("Values that `--set` may change.", _parameter()),
        "airframes": _named("Airframes by name.", _airframe()),
        "vehicles": _named("What flies, by name.", _vehicle()),
    }


def library_schema() -> Schema:
    """The shape of a library file."""
    return _mapping(
        "library", "What missions share.",
        {"library": _title(), **_shared()}, required=["library"],
    )  # fmt: skip


def skeleton() -> Schema:
    """The shape of a mission, with no part in it."""
    shared = _shared()
    shared["vehicles"] = {**shared["vehicles"], "minProperties": 1}
    return _mapping(
        "mission",
        "A kybflow mission: what flies, what it trusts, what it does, what is expected of it.",
        {
            "kybflow": {"description": "Version of the language.", "const": 1},
            "mission": _title(),
            **shared,
            "world": _mapping("world", "Where it flies.", {"fence": _fence()}),
            **_rates(),
            "expect": {
                "description": "What must hold for the mission to succeed.",
                "type": "array",
                "items": {"type": "string"},
            },
            "targets": _targets(),
        },
        required=["kybflow", "mission", "vehicles"],
    )


def _fence() -> Schema:
    return _mapping(
        "fence",
        "The box that no vehicle may leave.",
        {"from": vector(LENGTH, "Its lowest corner."), "to": vector(LENGTH, "Its highest corner.")},
        required=["from", "to"],
    )


def _rates() -> Schema:
    hover = "A hover that was entered by default lands after this; 30 s without it."
    limit = "The run ends after this at the latest; 600 s without it."
    rate = "Control rate, a whole number of Hz; 250 Hz without it."
    return {
        "control": quantity(FREQUENCY, rate, exclusiveMinimum=0),
        "hover_limit": quantity(DURATION, hover, exclusiveMinimum=0),
        "time_limit": quantity(DURATION, limit, exclusiveMinimum=0),
    }


def _targets() -> Schema:
    driver = _use("driver", "What flies it.")
    place = _mapping("vehicle's target", "How a vehicle is reached.", {"driver": driver})
    target = _named("One target: `all`, or a vehicle's name.", place)
    return _named("Where the mission can fly; `sim` is implied.", target)
