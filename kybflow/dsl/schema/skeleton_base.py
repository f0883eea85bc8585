"""What the shapes of the language's keys are made of; `skeleton` puts them together."""

from __future__ import annotations

from typing import Any

from kybflow.core.units import DURATION
from kybflow.dsl.schema.part_schema import Schema, quantity

NAME = r"^[A-Za-z_][A-Za-z0-9_]*(?!\n)$"
"""Python's `$` alone would let a line break end the name."""
DOTTED = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*(?!\n)$"


def title() -> Schema:
    """The name of a file's content; a run's folder is called by it."""
    return {"description": "Its name.", "type": "string", "pattern": NAME, "maxLength": 60}


def text(help: str) -> Schema:
    return {"description": help, "type": "string"}


def named(help: str, value: Schema, **more: Any) -> Schema:
    """A mapping of names to `value`."""
    names = {"pattern": NAME}
    return {
        "description": help, "type": "object", "propertyNames": names,
        "additionalProperties": value, **more,
    }  # fmt: skip


def mapping(title: str, help: str, properties: Schema, **more: Any) -> Schema:
    return {
        "title": title, "description": help, "type": "object", "properties": properties,
        "additionalProperties": False, **more,
    }  # fmt: skip


def use(title: str, help: str, extra: Schema | None = None) -> Schema:
    """A part by its bare name, or a mapping with `use` and its parameters."""
    properties = {
        "use": text("Name of the part."),
        "as": text("A name of its own, when the same part is used twice."),
        **(extra or {}),
    }
    return {
        "title": title, "description": help, "type": ["string", "object"],
        "properties": properties, "required": ["use"],
    }  # fmt: skip


def uses(title: str, help: str, extra: Schema | None = None) -> Schema:
    """A list of parts and of stacks of them."""
    part = use(title, "One of them.", extra)
    stack = text("A stack: its parts for this list stand here.")
    properties = {**part["properties"], "stack": stack}
    either = {
        "if": {"type": "object", "required": ["stack"]},
        "then": mapping("stack's place", "A stack.", {"stack": stack}),
        "else": {"title": title, "properties": properties, "required": part.pop("required")},
    }
    items = {**part, "properties": properties, **either}
    return {"description": help, "type": "array", "items": items}


NEXT = mapping(
    "transition",
    "One way out of a behavior: all of `when`, `event` and `after` that are written must hold.",
    {
        "when": text("A condition, like `state.altitude > 1 m`."),
        "event": text("An event to hear."),
        "after": quantity(DURATION, "Time in the behavior.", minimum=0),
        "for": quantity(DURATION, "How long the condition must hold.", minimum=0),
        "go": text("The behavior to go to."),
    },
    required=["go"],
)
