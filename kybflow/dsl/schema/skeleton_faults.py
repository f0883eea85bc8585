"""The shape of `faults:`, and no fault."""

from __future__ import annotations

from kybflow.core.units import DURATION
from kybflow.dsl.schema.part_schema import Schema, quantity
from kybflow.dsl.schema.skeleton_base import text


def faults_schema() -> Schema:
    """The list of faults; a fault's other keys are its part's parameters."""
    return {
        "description": "What breaks, and when; in simulation only.",
        "type": "array",
        "items": {
            "title": "fault",
            "description": "One thing that breaks on one vehicle: `at` a time, or `when`.",
            "type": "object",
            "properties": {
                "at": quantity(DURATION, "Time of the run.", minimum=0),
                "when": text("A condition: the first time that it holds, like `behavior == hop`."),
                "on": text("The vehicle."),
                "inject": text("The fault; its parameters are keys beside it."),
                "for": quantity(
                    DURATION, "How long it lasts; to the end without it.", exclusiveMinimum=0
                ),
            },
            "required": ["on", "inject"],
        },
    }
