"""What a drawing of a state machine is made of, before anybody knows where it goes."""

from __future__ import annotations

from typing import NamedTuple


class Box(NamedTuple):
    """A state: its name, its part, its flight type in words. A phase has none, and for a part what
    it asks."""

    name: str
    part: str
    flight: str
    is_built_in: bool


class Edge(NamedTuple):
    """All arrows from one state to another, a label each."""

    source: str
    target: str
    labels: tuple[str, ...]
    is_implied: bool


class Drawing(NamedTuple):
    """One machine; `title` names the vehicles that have it, or its flow."""

    title: str
    begin: str
    boxes: tuple[Box, ...]
    edges: tuple[Edge, ...]
