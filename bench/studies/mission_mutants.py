"""Mutants of missions: one node of the tree deleted, duplicated, swapped with its neighbour,
renamed, given another unit or linked elsewhere; and what is known of each without the checks.

A mutant `breaks` when a name, a unit, a link or the uniqueness of a key is wrong by the way in
which it was made. Of the others the oracle is `ends.ending`.
"""

from __future__ import annotations

import copy
import itertools
import random
import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

import yaml

from kybflow.core.units import DIMENSIONS, Dimension
from kybflow.parts import MOVING, Leg
from kybflow.parts.catalog import load_catalog

Node = yaml.Node
Path = tuple[int | str, ...]
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
KINDS = ("delete", "duplicate", "swap", "rename", "re-unit", "re-link")
LINKS = frozenset({"then", "failed", "go", "otherwise", "begin"})
_NAMES = LINKS | {"do", "use", "like", "airframe", "inject", "on", "stack", "event"}
_NEEDED = frozenset({"do", "use", "go", "mission", "kybflow", "vehicles", "inject", "on"})
_TOP = frozenset({"mission", "kybflow", "vehicles"})
_FREE = frozenset(
    {
        "vehicles", "behaviors", "parameters", "import", "points", "obstacles", "groups", "flows",
        "phases", "targets", "chains", "airframes", "stacks", "worlds", "states",
    }
)  # fmt: skip
_PROSE = frozenset({"summary", "help", "mission", "library", "log"})
_QUANTITY = re.compile(r"(?<![\w$.])([+-]?\d+\.?\d*)[ ]?(kg m\^2|m/s\^2|m/s|1/s|[a-zA-Z%]+)")
_WORD = re.compile(r"[A-Za-z_]\w*")


class Mutant(NamedTuple):
    """One mutated mission: what was done to which node, whether that breaks it by construction, and
    the lines at which a report of it is right."""

    kind: str
    what: str
    text: str
    breaks: bool
    lines: frozenset[int]


class _Place(NamedTuple):
    """A node, the one that holds it, the keys on the way."""

    path: Path
    parent: Node
    index: int
    keys: tuple[str, ...]


def tree_of(text: str) -> Node:
    """The tree of a mission, every node on lines of its own when it is written again."""
    root = yaml.compose(text, Loader=_LOADER)
    for place in places(root):
        node = _value(place.parent, place.index)
        if not isinstance(node, yaml.ScalarNode):
            node.flow_style = False
    root.flow_style = False
    return root


def text_of(root: Node) -> str:
    return yaml.serialize(root, Dumper=_DUMPER, allow_unicode=True, width=1000)


def places(root: Node) -> list[_Place]:
    """Every node but the root, outermost first; an aliased one where it comes first."""
    found: list[_Place] = []
    seen: set[int] = set()
    waiting: list[tuple[Node, Path, tuple[str, ...]]] = [(root, (), ())]
    while waiting:
        node, path, keys = waiting.pop(0)
        if id(node) in seen or isinstance(node, yaml.ScalarNode):
            continue
        seen.add(id(node))
        for index, item in enumerate(node.value):
            own = (*keys, item[0].value) if isinstance(node, yaml.MappingNode) else keys
            found.append(_Place((*path, index), node, index, own))
            waiting.append((_value(node, index), (*path, index), own))
    return found


def mutants(text: str, every: int = 1) -> Iterator[Mutant]:
    """Every mutant of one mission by one change of one node, or every so-manieth."""
    whole = tree_of(text)
    plain = text_of(whole)
    changes = (
        (place, kind, change)
        for place in places(whole)
        for kind in KINDS
        for change in _CHANGES[kind](whole, place)
    )
    for place, kind, change in itertools.islice(changes, 0, None, every):
        root = copy.deepcopy(whole)
        change.apply(_at(root, place.path[:-1]), place.index)
        mutated = text_of(root)
        if mutated != plain:
            yield Mutant(kind, change.what, mutated, change.breaks, _lines(mutated, place, change))


_ODD: tuple[Callable[[], Node], ...] = (
    lambda: yaml.ScalarNode("tag:yaml.org,2002:null", "null"),
    lambda: yaml.SequenceNode("tag:yaml.org,2002:seq", []),
    lambda: yaml.MappingNode("tag:yaml.org,2002:map", []),
    lambda: yaml.ScalarNode("tag:yaml.org,2002:int", "3"),
)
"""Values of a shape that is hardly ever right."""


def at_random(text: str, generator: random.Random) -> str:
    """`text` with one to three changes anywhere, or with noise in it."""
    if generator.random() < 0.2:
        return _noise(text, generator)
    root = tree_of(text)
    for _ in range(generator.randint(1, 3)):
        place = generator.choice(places(root))
        if generator.random() < 0.1:
            _put(generator.choice(_ODD)())(place.parent, place.index)
            continue
        changes = list(_CHANGES[generator.choice(KINDS)](root, place))
        if changes:
            generator.choice(changes).apply(place.parent, place.index)
    return text_of(root)


def _noise(text: str, generator: random.Random) -> str:
    for _ in range(generator.randint(1, 4)):
        start = generator.randint(0, len(text))
        alphabet = "[]{}:,-&*!|>'\"%@`#?$ \n\tabz019.é\x85\u2028"
        put = "".join(generator.choices(alphabet, k=generator.randint(0, 6)))
        text = text[:start] + put + text[start + generator.randint(0, 10) :]
    return text


class _Change(NamedTuple):
    what: str
    apply: Callable[[Node, int], None]
    breaks: bool = False
    words: tuple[str, ...] = ()


def _value(parent: Node, index: int) -> Node:
    item = parent.value[index]
    return item[1] if isinstance(parent, yaml.MappingNode) else item


def _at(root: Node, path: Path) -> Node:
    for step in path:
        root = _value(root, int(step))
    return root


def _put(value: Node) -> Callable[[Node, int], None]:
    def put(parent: Node, index: int) -> None:
        old = parent.value[index]
        parent.value[index] = (old[0], value) if isinstance(parent, yaml.MappingNode) else value

    return put


def _scalar(text: str) -> Node:
    return yaml.ScalarNode("tag:yaml.org,2002:str", text)


def _is_key(place: _Place) -> bool:
    return isinstance(place.parent, yaml.MappingNode)


def _defines(place: _Place) -> bool:
    """Whether the key of a place is a name that its author chose."""
    return _is_key(place) and len(place.keys) > 1 and place.keys[-2] in _FREE


def _mentions(root: Node, place: _Place) -> bool:
    """Whether a link, a condition or a parameter's use names what the place defines: for a behavior
    in its own vehicle or outside of all."""
    name = place.keys[-1]
    if "targets" in place.keys:
        return False
    own = place.keys[:2] if place.keys[0] == "vehicles" and len(place.keys) > 2 else ()
    for other in places(root):
        node = _value(other.parent, other.index)
        if not isinstance(node, yaml.ScalarNode) or set(other.keys) & _PROSE:
            continue
        if own and other.keys[0] == "vehicles" and other.keys[:2] != own:
            continue
        is_reference = other.keys[-1] in _NAMES | {"when", "healthy"} or "$" in node.value
        if is_reference and name in _WORD.findall(node.value) and other.keys[:-1] != place.keys:
            return True
    return False


def _delete(root: Node, place: _Place) -> Iterator[_Change]:
    name = place.keys[-1] if place.keys else ""
    needed = _is_key(place) and not _defines(place) and name in _NEEDED
    needed = needed and (len(place.keys) > 1) is (name not in _TOP)
    needed = needed and place.keys[-2:] != ("tracker", "use")  # `like` brings it
    breaks = needed or (_defines(place) and _mentions(root, place))
    what = f"delete {'.'.join(place.keys)}"
    yield _Change(what, lambda p, i: p.value.pop(i), breaks, (name,) if _defines(place) else ())


def _duplicate(_: Node, place: _Place) -> Iterator[_Change]:
    def apply(parent: Node, index: int) -> None:
        parent.value.insert(index, copy.deepcopy(parent.value[index]))

    yield _Change(f"duplicate {'.'.join(place.keys)}", apply, _is_key(place))


def _swap(_: Node, place: _Place) -> Iterator[_Change]:
    if place.index + 1 >= len(place.parent.value):
        return

    def apply(parent: Node, index: int) -> None:
        a, b = _value(parent, index), _value(parent, index + 1)
        _put(b)(parent, index)
        _put(a)(parent, index + 1)

    words = [n.value for n in (_value(place.parent, place.index + i) for i in (0, 1))
             if isinstance(n, yaml.ScalarNode)]  # fmt: skip
    names = (
        [str(k[0].value) for k in place.parent.value[place.index :][:2]] if _is_key(place) else []
    )
    yield _Change(f"swap {'.'.join(place.keys)}", apply, words=(*words, *names))


def _rename(root: Node, place: _Place) -> Iterator[_Change]:
    if _is_key(place):
        name = place.keys[-1]

        def rekey(parent: Node, index: int) -> None:
            key, value = parent.value[index]
            parent.value[index] = (_scalar(f"{key.value}x"), value)

        breaks = not _defines(place) or _mentions(root, place)
        yield _Change(f"rename key {'.'.join(place.keys)}", rekey, breaks, (name, f"{name}x"))
    node = _value(place.parent, place.index)
    if isinstance(node, yaml.ScalarNode) and place.keys[-1] in _NAMES and _WORD.search(node.value):
        name = f"{node.value}x"
        words = (node.value, name)
        yield _Change(f"rename {node.value}", _put(_scalar(name)), True, words)


def _re_unit(_: Node, place: _Place) -> Iterator[_Change]:
    node = _value(place.parent, place.index)
    if not isinstance(node, yaml.ScalarNode) or set(place.keys) & _PROSE:
        return
    for match in _QUANTITY.finditer(node.value):
        own = _dimension(match[2])
        if own is None:
            continue
        others = [unit for unit in own.units if unit != match[2] and own.units[unit] != 1.0][:2]
        foreign = "s" if own.name != "duration" else "m"
        for unit in (*others, foreign):
            text = f"{node.value[: match.start(2)].rstrip()} {unit}{node.value[match.end(2) :]}"
            what = f"re-unit {node.value} to {text}"
            yield _Change(what, _put(_scalar(text)), unit == foreign, tuple(place.keys[-1:]))


def _dimension(unit: str) -> Dimension | None:
    return next((d for d in DIMENSIONS.values() if unit in d.units), None)


def _re_link(root: Node, place: _Place) -> Iterator[_Change]:
    node = _value(place.parent, place.index)
    if not _is_key(place) or place.keys[-1] not in LINKS or "behaviors" not in place.keys:
        return
    states = _states(root, place)
    source = place.keys[place.keys.index("behaviors") + 1] if place.keys[-1] != "begin" else ""
    for target in states:
        if target == node.value:
            continue
        legs = states.get(source, ()), states[target]
        breaks = bool(legs[0] and legs[1]) and not _fit(*legs, place.keys[-1])
        words = (source, target, node.value)
        what = f"re-link {source}.{place.keys[-1]} to {target}"
        yield _Change(what, _put(_scalar(target)), breaks, words)


def _states(root: Node, place: _Place) -> dict[str, tuple[Leg, ...]]:
    """The states beside a link and their flight types; none for a part that is not at hand."""
    depth = place.keys.index("behaviors") + 1
    behaviors = root
    for key in place.keys[:depth]:
        behaviors = next(v for k, v in behaviors.value if k.value == key)
    found = {}
    for key, body in behaviors.value:
        pairs = body.value if isinstance(body, yaml.MappingNode) else []
        part = next((v.value for k, v in pairs if k.value == "do"), "")
        known = part in load_catalog().names("behaviors")
        found[key.value] = load_catalog().get("behaviors", part).cls.flight if known else ()
    return found


def _fit(source: tuple[Leg, ...], target: tuple[Leg, ...], cause: str) -> bool:
    """Whether some end of one behavior is a start of the other."""
    ends = {leg.end if cause == "then" or leg.start is leg.end else MOVING for leg in source}
    return bool(ends & {leg.start for leg in target})


_CHANGES: dict[str, Callable[[Node, _Place], Iterator[_Change]]] = {
    "delete": _delete,
    "duplicate": _duplicate,
    "swap": _swap,
    "rename": _rename,
    "re-unit": _re_unit,
    "re-link": _re_link,
}


def _lines(text: str, place: _Place, change: _Change) -> frozenset[int]:
    """The lines of the changed node and its neighbours, the keys of what holds it, and every line
    with a name that the change took away, made or leads to."""
    root = yaml.compose(text, Loader=_LOADER)
    holder = _at(root, place.path[:-1])
    items = holder.value if isinstance(holder.value, list) else []
    right = {holder.start_mark.line + 1, holder.start_mark.line}
    for item in items:
        key = item[0] if isinstance(item, tuple) else item
        right.add(key.start_mark.line + 1)
    for index in (place.index, place.index + 1):
        if index < len(items):
            node = _value(holder, index)
            right.update(range(node.start_mark.line + 1, node.end_mark.line + 2))
    words = set(change.words) - {""}
    for number, line in enumerate(text.split("\n"), 1):
        if words & set(_WORD.findall(line)):
            right.add(number)
    return frozenset(right)
