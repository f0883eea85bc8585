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
    sensing,
    slips,
    structure,
    supervisors,
    time_and_energy,
    valid_variants,
)
from harms.operator import Operator

HARMFUL = (
    slips, physics, expectations, supervisors, time_and_energy, plants, sensing, structure, fleets,
    rooms, faults_and_callbacks, parameters, avoidance, formations, labs_and_hands,
)  # fmt: skip


def _of(module: ModuleType) -> list[Operator]:
    return [value for value in vars(module).values() if isinstance(value, Operator)]


OPERATORS: tuple[Operator, ...] = tuple(op for module in HARMFUL for op in _of(module))
VALID: tuple[Operator, ...] = tuple(_of(valid_variants))
