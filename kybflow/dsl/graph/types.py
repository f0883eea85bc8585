"""What a drawing of a state machine is made of, before anybody knows where it goes."""

from __future__ import annotations

from typing import NamedTuple


class Box(NamedTuple):
    """A state: its name, its part, its flight type in words. A phase has none, and for a part what
    it asks. An asker is no state: a flow or a callback that may ask for states."""

    name: str
    part: str
    flight: str
    is_built_in: bool
    is_asker: bool = False


class Edge(NamedTuple):
    """All arrows from one state to another, a label each; `is_asked`: from who may ask for it."""

    source: str
    target: str
    labels: tuple[str, ...]
    is_implied: bool
    is_asked: bool = False


class Drawing(NamedTuple):
    """One machine; `title` names the vehicles that have it, or its flow."""

    title: str
    begin: str
    boxes: tuple[Box, ...]
    edges: tuple[Edge, ...]
