"""The operators, a family a file: what people do wrong, and why it harms or says nothing."""

from __future__ import annotations

from types import ModuleType

from harms.families import (
    avoidance,
    expectations,
    faults_and_callbacks,
    fleets,
    formations,
    labs_and_hands,
    parameters,
    physics,
    plants,
    rooms,
    second_opinion,
    sensing,
    slips,
    structure,
    supervisors,
    third_opinion,
    time_and_energy,
    valid_variants,
)
from harms.operator import Operator

HARMFUL = (
    slips, physics, expectations, supervisors, time_and_energy, plants, sensing, structure, fleets,
    rooms, faults_and_callbacks, parameters, avoidance, formations, labs_and_hands, second_opinion,
    third_opinion,
)  # fmt: skip


def _of(module: ModuleType) -> list[Operator]:
    return [value for value in vars(module).values() if isinstance(value, Operator)]


ALL = tuple(op for module in (*HARMFUL, valid_variants) for op in _of(module))
OPERATORS: tuple[Operator, ...] = tuple(op for op in ALL if op.label != "valid")
VALID: tuple[Operator, ...] = tuple(op for op in ALL if op.label == "valid")
