"""A shipped mission to be changed as text: its nodes by name, what of it the plan knows, and edits
at the places of nodes. Comments and layout stay, so that a line means what it meant."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts.catalog import load_catalog

Node = yaml.Node
_NUMBER = re.compile(r"([+-]?\d+(?:\.\d+)?) ?(.*)", re.DOTALL)


class Edit(NamedTuple):
    """The characters from `start` to `end` become `text`."""

    start: int
    end: int
    text: str


class State(NamedTuple):
    """A behavior that the mission's own text has with its `do`. key: the node of its name."""

    vehicle: str
    name: str
    do: str
    key: Node
    node: Node


class Vehicle(NamedTuple):
    name: str
    key: Node
    node: Node


class Quantity(NamedTuple):
    """A number and its unit, as written."""

    number: float
    unit: str

    def __str__(self) -> str:
        return f"{self.number:g} {self.unit}".strip()


class Mission:
    """A mission's text and tree, and the plan that the compiler makes of it unchanged."""

    def __init__(self, path: Path) -> None:
        self.name = path.stem
        self.text = path.read_text(encoding="utf-8")
        self.root = yaml.compose(self.text, Loader=yaml.SafeLoader)
        plan = compile_mission(path, catalog=load_catalog()).plan
        assert plan is not None, f"{path} is not valid before it is changed"
        self.plan: Plan = plan

    def line(self, index: int) -> int:
        return self.text.count("\n", 0, index) + 1

    def pairs(self, *keys: str, of: Node | None = None) -> list[tuple[Node, Node]]:
        """The keys and values of the mapping at `keys`; none where there is no such mapping."""
        node = self.at(*keys, of=of)
        return list(node.value) if isinstance(node, yaml.MappingNode) else []

    def at(self, *keys: str, of: Node | None = None) -> Node | None:
        """The node under `keys`, from the root or from `of`."""
        node = of or self.root
        for key in keys:
            found = node.value if isinstance(node, yaml.MappingNode) else []
            node = next((value for name, value in found if name.value == key), None)
            if node is None:
                return None
        return node

    def items(self, *keys: str, of: Node | None = None) -> list[Node]:
        """The items of the list at `keys`."""
        node = self.at(*keys, of=of)
        return list(node.value) if isinstance(node, yaml.SequenceNode) else []

    def word(self, *keys: str, of: Node | None = None) -> str:
        """The scalar at `keys`, empty where there is none."""
        node = self.at(*keys, of=of)
        return str(node.value) if isinstance(node, yaml.ScalarNode) else ""

    def vehicles(self) -> list[Vehicle]:
        return [Vehicle(key.value, key, node) for key, node in self.pairs("vehicles")]

    def own(self) -> list[Vehicle]:
        """The vehicles that are not like another one of the mission."""
        return [v for v in self.vehicles() if "." in self.word("like", of=v.node)]

    def planned(self, name: str) -> VehiclePlan:
        return self.plan.fleet[self.plan.members(name)[0]]

    def states(self, *parts: str) -> list[State]:
        """The states that are written with one of these parts, or all; shared ones once."""
        found: dict[int, State] = {}
        for vehicle in self.vehicles():
            for key, node in self.pairs("behaviors", of=vehicle.node):
                do = self.word("do", of=node)
                if do and (not parts or do in parts):
                    found.setdefault(id(node), State(vehicle.name, key.value, do, key, node))
        return list(found.values())

    def landing(self, vehicle: str) -> str:
        """A state in which a vehicle lands where it is; empty where it has none."""
        names = [s.name for s in self.states("land") if s.vehicle == vehicle]
        return names[-1] if names else ""

    def flying(self, *parts: str) -> list[State]:
        """The states in the air whose vehicle has a state to land in."""
        air = parts or ("hover", "fly_to", "follow_path", "circle", "figure_eight", "steer")
        return [s for s in self.states(*air) if self.landing(s.vehicle)]

    def phases(self) -> Iterator[tuple[str, Node]]:
        """The phases that the mission's own text has, each with its name."""
        for _, flow in self.pairs("flows"):
            for name, phase in self.pairs("phases", of=flow):
                yield name.value, phase

    def source(self, node: Node) -> str:
        """The text of a node."""
        return self.text[node.start_mark.index : node.end_mark.index]

    def expectations(self, *words: str) -> list[Node]:
        """The expectations with all of these words."""
        return [n for n in self.items("expect") if all(word in n.value for word in words)]

    def quantity(self, node: Node | None) -> Quantity | None:
        """What is written, or the default of the parameter that is used."""
        text = node.value if isinstance(node, yaml.ScalarNode) else ""
        if text.startswith("$"):
            return self.quantity(self.at("parameters", text[1:], "default"))
        match = _NUMBER.fullmatch(text)
        return Quantity(float(match[1]), match[2]) if match else None

    def written(self, node: Node | None) -> Quantity | None:
        """What is written in this place itself."""
        is_used = isinstance(node, yaml.ScalarNode) and node.value.startswith("$")
        return None if is_used else self.quantity(node)


def put(node: Node, text: str) -> Edit:
    """A scalar or a flow collection becomes `text`."""
    return Edit(node.start_mark.index, node.end_mark.index, text)


def add(mapping: Node, entry: str) -> Edit:
    """A mapping has one more entry, the first."""
    first = mapping.value[0][0].start_mark
    gap = ", " if mapping.flow_style else f"\n{' ' * first.column}"
    return Edit(first.index, first.index, f"{entry}{gap}")


def add_last(mapping: Node, entry: str) -> Edit:
    """A mapping has one more entry, the last."""
    end = mapping.value[-1][1].end_mark.index
    gap = ", " if mapping.flow_style else f"\n{' ' * mapping.value[0][0].start_mark.column}"
    return Edit(end, end, f"{gap}{entry}")


def with_key(mission: Mission, mapping: Node, key: str, text: str) -> Edit:
    """A mapping has `key: text`; a new key stands last."""
    node = mission.at(key, of=mapping)
    return put(node, text) if node else add_last(mapping, f"{key}: {text}")


def append(sequence: Node, item: str) -> Edit:
    """A list has one more item, the last of a flow list, the first of a block list."""
    if sequence.flow_style:
        start = sequence.value[-1].end_mark.index if sequence.value else sequence.end_mark.index - 1
        return Edit(start, start, f", {item}" if sequence.value else item)
    start = sequence.start_mark.index
    return Edit(start, start, f"- {item}\n{' ' * sequence.start_mark.column}")


def drop(mission: Mission, mapping: Node, key: str) -> Edit:
    """A mapping has no entry `key` any more."""
    index = next(i for i, (name, _) in enumerate(mapping.value) if name.value == key)
    name, value = mapping.value[index]
    if mapping.flow_style:
        if index + 1 < len(mapping.value):
            return Edit(name.start_mark.index, mapping.value[index + 1][0].start_mark.index, "")
        before = mapping.value[index - 1][1].end_mark.index if index else name.start_mark.index
        return Edit(before, value.end_mark.index, "")
    start = mission.text.rfind("\n", 0, name.start_mark.index) + 1
    if index + 1 < len(mapping.value):
        end = mapping.value[index + 1][0].start_mark.index
        return Edit(start, mission.text.rfind("\n", 0, end) + 1, "")
    end = mission.text.find("\n", value.end_mark.index - 1)
    return Edit(start, end + 1, "")


def own_section(mission: Mission, section: str, entry: str) -> Edit:
    """The mission's section has one more entry; where it has none, it stands before `vehicles`."""
    node = mission.at(section)
    if isinstance(node, yaml.MappingNode) and node.value:
        return add(node, entry)
    key = next(name for name, _ in mission.root.value if name.value == "vehicles")
    start = key.start_mark.index
    return Edit(start, start, f"{section}:\n  {entry}\n\n")


def own_list(mission: Mission, section: str, item: str) -> Edit:
    """The mission's list has one more item; where it has none, it stands before `vehicles`."""
    node = mission.at(section)
    if isinstance(node, yaml.SequenceNode):
        return append(node, item)
    key = next(name for name, _ in mission.root.value if name.value == "vehicles")
    start = key.start_mark.index
    return Edit(start, start, f"{section}:\n  - {item}\n\n")


def edited(
    mission: Mission, edits: tuple[Edit, ...], also: tuple[Node, ...]
) -> tuple[str, frozenset[int]]:
    """The text after the edits, and the lines in it of what was edited and of the nodes `also`."""
    text, shift, lines = mission.text, 0, set[int]()
    moved: list[tuple[int, int]] = []
    for edit in sorted(edits):
        start = edit.start + shift
        text = text[:start] + edit.text + text[edit.end + shift :]
        first = text.count("\n", 0, start) + 1
        lines.update(range(first, first + edit.text.rstrip().count("\n") + 1))
        shift += len(edit.text) - (edit.end - edit.start)
        moved.append((edit.start, shift))
    for node in also:
        index = node.start_mark.index
        by = next((s for start, s in reversed(moved) if start <= index), 0)
        lines.add(text.count("\n", 0, max(index + by, 0)) + 1)
    return text, frozenset(lines)


def everywhere(node: Node, seen: set[int] | None = None) -> Iterator[tuple[Node, Node]]:
    """Every key and value of every mapping below a node, each once."""
    seen = set() if seen is None else seen
    if id(node) in seen or isinstance(node, yaml.ScalarNode):
        return
    seen.add(id(node))
    for item in node.value:
        if isinstance(node, yaml.MappingNode):
            yield item
        yield from everywhere(item[1] if isinstance(node, yaml.MappingNode) else item, seen)
