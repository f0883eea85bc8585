"""Layered layout of a directed graph, after Sugiyama, Tagawa and Toda (1981).

A box's layer follows from the longest path to it over the arrows that do not close a cycle. Each
arrow becomes a chain with one vertex in every layer that it passes; the first of them carries its
label, so neither boxes nor labels can overlap. Barycentres determine the order within a layer.
Positions are the feasible ones nearest to the mean of the neighbours (isotonic regression), in
sweeps down and up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

GAP = 32.0
_SWEEPS = 12


class Size(NamedTuple):
    """The extent of a vertex to the left and right of the vertical line through it, and its
    height."""

    left: float
    right: float
    height: float


class EdgePath(NamedTuple):
    """The course of one arrow. vertices: its vertices from the upper end to the lower. is_reversed:
    whether the arrow points up."""

    vertices: tuple[int, ...]
    is_reversed: bool


@dataclass(slots=True)
class Layout:
    """The positions of all vertices: first the boxes, then the vertices of the chains. layers: the
    vertices of each layer in order. chains: the course of each arrow. x: the vertical line through
    each vertex. y: the middle of its height."""

    sizes: list[Size]
    layers: list[list[int]] = field(default_factory=list)
    chains: list[EdgePath] = field(default_factory=list)
    x: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)


def arranged(
    boxes: Sequence[Size], edges: Sequence[tuple[int, int]], labels: Sequence[Size], first: int
) -> Layout:
    """Return the layout of boxes joined by edges. edges: (source, target), without loops. labels:
    the size of each edge's label. first: the box from which the layout begins at the top."""
    back = _closing(len(boxes), edges, first)
    down = [(b, a) if i in back else (a, b) for i, (a, b) in enumerate(edges)]
    ranks = _ranks(len(boxes), down)
    layout = Layout(list(boxes))
    layout.layers = [[] for _ in range(2 * max(ranks) + 1)]
    for box, rank in enumerate(ranks):
        layout.layers[2 * rank].append(box)
    for index, (upper, lower) in enumerate(down):
        passed: list[int] = []
        for layer in range(2 * ranks[upper] + 1, 2 * ranks[lower]):
            layout.layers[layer].append(len(layout.sizes))
            passed.append(len(layout.sizes))
            layout.sizes.append(Size(4.0, 4.0, 0.0) if passed[1:] else labels[index])
        layout.chains.append(EdgePath((upper, *passed, lower), index in back))
    above, below = _neighbours(layout)
    _order(layout, above, below)
    _place(layout, above, below)
    return layout


def _closing(count: int, edges: Sequence[tuple[int, int]], first: int) -> set[int]:
    """Return the edges that close a cycle in a depth-first search from `first`."""
    leaving: list[list[int]] = [[] for _ in range(count)]
    for number, (source, _) in enumerate(edges):
        leaving[source].append(number)
    closing: set[int] = set()
    open_vertices: set[int] = set()
    seen: set[int] = set()
    for root in (first, *range(count)):
        path = [(root, iter(leaving[root]))] if root not in seen else []
        while path:
            vertex, rest = path[-1]
            seen.add(vertex)
            open_vertices.add(vertex)
            ahead = (n for n in rest if edges[n][1] in open_vertices or edges[n][1] not in seen)
            taken = next(ahead, None)
            if taken is None:
                open_vertices.discard(vertex)
                path.pop()
            elif edges[taken][1] in open_vertices:
                closing.add(taken)
            else:
                target = edges[taken][1]
                path.append((target, iter(leaving[target])))
    return closing


def _ranks(count: int, down: Sequence[tuple[int, int]]) -> list[int]:
    """Return the length of the longest path to each vertex; `down` has no cycles."""
    ranks = [0] * count
    for _ in range(count):
        for source, target in down:
            ranks[target] = max(ranks[target], ranks[source] + 1)
    return ranks


Neighbours = Mapping[int, list[int]]


def _neighbours(layout: Layout) -> tuple[Neighbours, Neighbours]:
    above: dict[int, list[int]] = {v: [] for v in range(len(layout.sizes))}
    below: dict[int, list[int]] = {v: [] for v in range(len(layout.sizes))}
    for chain in layout.chains:
        for a, b in pairwise(chain.vertices):
            below[a].append(b)
            above[b].append(a)
    return above, below


def _order(layout: Layout, above: Neighbours, below: Neighbours) -> None:
    """Sort every layer by the mean position of each vertex's neighbours, in sweeps down and up."""
    place = {v: float(i) for layer in layout.layers for i, v in enumerate(layer)}
    for sweep in range(_SWEEPS):
        neighbours = below if sweep % 2 else above
        for layer in reversed(layout.layers) if sweep % 2 else layout.layers:
            means = {v: _mean([place[n] for n in neighbours[v]], place[v]) for v in layer}
            layer.sort(key=means.__getitem__)
            for index, vertex in enumerate(layer):
                place[vertex] = float(index)


def _place(layout: Layout, above: Neighbours, below: Neighbours) -> None:
    layout.x = [0.0] * len(layout.sizes)
    for sweep in range(_SWEEPS + 1):
        neighbours = below if sweep % 2 else above
        for layer in reversed(layout.layers) if sweep % 2 else layout.layers:
            wanted = [_mean([layout.x[n] for n in neighbours[v]], layout.x[v]) for v in layer]
            for vertex, x in zip(layer, _apart(layout, layer, wanted), strict=True):
                layout.x[vertex] = x
    left = min(x - s.left for x, s in zip(layout.x, layout.sizes, strict=True))
    layout.x = [x - left for x in layout.x]
    layout.y = [0.0] * len(layout.sizes)
    top = 0.0
    for layer in layout.layers:
        height = max((layout.sizes[v].height for v in layer), default=0.0)
        for vertex in layer:
            layout.y[vertex] = top + height / 2
        top += height + GAP


def _apart(layout: Layout, layer: Sequence[int], wanted: Sequence[float]) -> list[float]:
    """Return the positions nearest to the wanted ones (least squares) that keep the order and the
    gaps: isotonic regression of the positions after the gaps are subtracted."""
    offsets = [0.0]
    for a, b in pairwise(layer):
        offsets.append(offsets[-1] + layout.sizes[a].right + GAP + layout.sizes[b].left)
    blocks: list[tuple[float, int]] = []
    for want, offset in zip(wanted, offsets, strict=False):
        mean, count = want - offset, 1
        while blocks and blocks[-1][0] > mean:
            other, size = blocks.pop()
            mean, count = (mean * count + other * size) / (count + size), count + size
        blocks.append((mean, count))
    levels = [mean for mean, count in blocks for _ in range(count)]
    return [level + offset for level, offset in zip(levels, offsets, strict=False)]


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise
