"""Conditions and expectations: a small typed language without commas, brackets or braces, because
YAML would end a value at them inside `{...}`. This package exports the tree, `parse` and
`describe`."""

from __future__ import annotations

from kybflow.dsl.expressions.parse import Scope, parse
from kybflow.dsl.expressions.tree import (
    Aggregate,
    Always,
    And,
    Axis,
    Clearance,
    Compare,
    Condition,
    Distance,
    Eventually,
    Expression,
    Finally,
    Finished,
    GroupInState,
    InState,
    Location,
    MissionTime,
    Not,
    Or,
    Quantity,
    Read,
    Separation,
    Word,
    describe,
)

__all__ = [
    "Aggregate", "Always", "And", "Axis", "Clearance", "Compare", "Condition", "Distance",
    "Eventually", "Expression", "Finally", "Finished", "GroupInState", "InState", "Location",
    "MissionTime", "Not", "Or", "Quantity", "Read", "Scope", "Separation", "Word", "describe",
    "parse",
]  # fmt: skip
