"""Arrange the drawings of state machines, and write them as SVG without scripts, fonts or links.

The layout is layered, after Sugiyama, Tagawa and Toda (1981). A box's layer follows from the
longest path to it over the arrows that do not close a cycle. Each arrow becomes a chain with one
vertex in every layer that it passes; the first of them carries its label, so neither boxes nor
labels can overlap. Barycentres determine the order within a layer. Positions are the feasible ones
nearest to the mean of the neighbours (isotonic regression), in sweeps down and up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from typing import NamedTuple

from kybflow.dsl.graph.drawing import Drawing, Edge, StateBox, drawings
from kybflow.dsl.plan import Plan

GAP = 32.0
_SWEEPS = 12


class Size(NamedTuple):
    """The extent of a vertex to the left and right of the vertical line through it, and its
    height."""

    left: float
    right: float
    height: float


class EdgePath(NamedTuple):
    """The course of one arrow. vertices: the vertices that it passes, from its upper end to its
    lower end. is_reversed: whether the arrow points up."""

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
    ranks = [0] * len(boxes)  # the length of the longest path to each box; `down` has no cycles
    for source, target in down * len(boxes):
        ranks[target] = max(ranks[target], ranks[source] + 1)
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
    gaps. This is an isotonic regression of the positions from which the gaps are subtracted."""
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


_HEIGHT = 46.0
_MARGIN = 28.0
_TOP = 126
_ROW_WIDTH = 1760.0
_ENTRY = 34.0
_LINE = 15.0
_STYLE = """
  text { font-family: system-ui, 'Segoe UI', Helvetica, Arial, sans-serif; fill: #1d2733 }
  .title { font-size: 19px; font-weight: 600 } .summary { font-size: 13px; fill: #5b6875 }
  .machine { font-size: 14px; font-weight: 600; fill: #2f5d8a }
  .name { font-size: 14px; font-weight: 600; text-anchor: middle }
  .part { font-size: 11px; fill: #5b6875; text-anchor: middle }
  .label { font-size: 11.5px; fill: #33414e }
  .box { stroke-width: 1.4 } .ground { fill: #f1ede4; stroke: #a08c5b }
  .air { fill: #e4eff9; stroke: #4a86bd } .change { fill: #e6f4ea; stroke: #4d9a63 }
  .phase { fill: #efe9f6; stroke: #8468ad }
  .asker { fill: #ffffff; stroke: #8468ad; stroke-dasharray: 2 3 }
  .implied { fill: #ffffff; stroke: #a9b3bd; stroke-dasharray: 5 3 }
  .edge { fill: none; stroke: #52606d; stroke-width: 1.4 }
  .asked { stroke: #8468ad; stroke-dasharray: 2 3 }
  .faint { stroke: #a9b3bd; stroke-dasharray: 5 3 } .faint-text { fill: #7b8794 }
"""
_ARROW = (
    '<marker id="arrow" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
    'orient="auto-start-reverse"><path d="M1 1 L9 5 L1 9 z" fill="#52606d"/></marker>'
)

Point = tuple[float, float]
_FOOTNOTE = (
    "A behavior that fails and does not say what follows brakes, hovers and lands; "
    "a take-off lands. The dot is where a machine begins."
)


def svg(plan: Plan) -> str:
    """Return the state machines as a self-contained SVG, in rows under the mission's name."""
    title, summary = plan.mission, plan.summary
    drawn = [_drawing(drawing) for drawing in drawings(plan)]
    places, right, bottom = _in_rows([(width, height) for _, width, height in drawn])
    parts = [
        f'<g transform="translate({x:.1f} {y:.1f})">{body}</g>'
        for (body, _, _), (x, y) in zip(drawn, places, strict=True)
    ]
    texts = (_width(title, 11.0), _width(summary, 6.6), _width(_FOOTNOTE, 6.0))
    width = max(right + _MARGIN, max(texts) + 2 * _MARGIN)
    height = bottom + 2.2 * _MARGIN
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" role="img">',
            f"<style>{_STYLE}</style><defs>{_ARROW}</defs>",
            f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
            _text(_MARGIN, 40, title, "title"),
            _text(_MARGIN, 61, summary, "summary"),
            *parts,
            _text(_MARGIN, height - 18, _FOOTNOTE, "part faint-text", 'style="text-anchor: start"'),
            "</svg>\n",
        ]
    )


def _in_rows(sizes: Sequence[Point]) -> tuple[list[Point], float, float]:
    """Return the position of each drawing, the right end of all, and their bottom. A row is at most
    `_ROW_WIDTH` wide unless it holds a single wider drawing."""
    places: list[Point] = []
    x, y, right, bottom = _MARGIN, float(_TOP), 0.0, float(_TOP)
    for width, height in sizes:
        if x > _MARGIN and x + width > _ROW_WIDTH:
            x, y = _MARGIN, bottom + 3 * _MARGIN
        places.append((x, y))
        right, bottom = max(right, x + width), max(bottom, y + height)
        x += width + 3 * _MARGIN
    return places, right, bottom


def _drawing(drawing: Drawing) -> tuple[str, float, float]:
    """Return the SVG of one machine, its width and its height."""
    index = {box.name: i for i, box in enumerate(drawing.boxes)}
    loops = {e.source: e for e in drawing.edges if e.source == e.target}
    edges = [e for e in drawing.edges if e.source != e.target]
    sizes = [_box_size(b, loops.get(b.name), b.name == drawing.begin) for b in drawing.boxes]
    ends = [(index[e.source], index[e.target]) for e in edges]
    labels = [_label_size(e.labels) for e in edges]
    layout = arranged(sizes, ends, labels, index[drawing.begin])
    ports = _ports(layout)
    first = index[drawing.begin]
    parts = [_begin(drawing.boxes[first], layout.x[first], layout.y[first])]
    parts += [_edge(layout, number, edge, ports) for number, edge in enumerate(edges)]
    for number, box in enumerate(drawing.boxes):
        parts.append(_box(box, layout.x[number], layout.y[number]))
        if box.name in loops:
            parts.append(_loop(loops[box.name], box, layout.x[number], layout.y[number]))
    parts.append(_text(0, -26, drawing.title, "machine"))
    width = max(x + size.right for x, size in zip(layout.x, layout.sizes, strict=True))
    height = max(y + size.height / 2 for y, size in zip(layout.y, layout.sizes, strict=True))
    return "\n".join(parts), max(width, _width(drawing.title, 8.0)), height


def _box_size(box: StateBox, loop: Edge | None, is_first: bool) -> Size:
    half = _box_width(box) / 2
    return Size(
        half + (_ENTRY if is_first else 0.0),
        half + (_label_size(loop.labels).right + 28 if loop else 0.0),
        _HEIGHT,
    )


def _box_width(box: StateBox) -> float:
    return max(_width(box.name, 8.2), _width(_caption(box), 6.2)) + 28


def _caption(box: StateBox) -> str:
    return f"{box.part} · {box.flight}" if box.flight else box.part


def _label_size(labels: Sequence[str]) -> Size:
    longest = max((_width(label, 6.3) for label in labels), default=0.0)
    return Size(6.0, longest + 10, _LINE * len(labels) + 4)


def _width(text: str, each: float) -> float:
    return len(text) * each


Ports = Mapping[tuple[int, int], float]


def _ports(layout: Layout) -> Ports:
    """Return the x at which each chain meets its boxes, by (chain, end); the end is 0 for the upper
    and 1 for the lower."""
    sides: dict[tuple[int, int], list[tuple[float, int]]] = {}
    for number, chain in enumerate(layout.chains):
        upper, lower = chain.vertices[0], chain.vertices[-1]
        sides.setdefault((upper, 0), []).append((layout.x[chain.vertices[1]], number))
        sides.setdefault((lower, 1), []).append((layout.x[chain.vertices[-2]], number))
    ports = {}
    for (vertex, end), neighbours in sides.items():
        step = min(26.0, 1.6 * layout.sizes[vertex].left / (len(neighbours) + 1))
        for place, (_, number) in enumerate(sorted(neighbours)):
            shift = (place - (len(neighbours) - 1) / 2) * step
            ports[number, end] = layout.x[vertex] + shift
    return ports


def _edge(layout: Layout, number: int, edge: Edge, ports: Ports) -> str:
    chain = layout.chains[number]
    upper, *passed, lower = chain.vertices
    half = _HEIGHT / 2
    points = [(ports[number, 0], layout.y[upper] + half)]
    for vertex in passed:
        reach = max(layout.sizes[vertex].height / 2, half / 2)
        points += [(layout.x[vertex], layout.y[vertex] + side * reach) for side in (-1, 1)]
    points.append((ports[number, 1], layout.y[lower] - half))
    if chain.is_reversed:
        points.reverse()
    faint = edge.is_implied
    style = " faint" if faint else " asked" if edge.is_request else ""
    line = f'<path class="edge{style}" d="{_curve(points)}" {_MARKED}/>'
    x, y = layout.x[passed[0]], layout.y[passed[0]]
    return line + _label(edge.labels, x + 7, y, "label faint-text" if faint else "label")


_MARKED = 'marker-end="url(#arrow)"'


def _curve(points: Sequence[Point]) -> str:
    """Return a path through the points that is vertical at each of them."""
    path = [f"M{points[0][0]:.1f} {points[0][1]:.1f}"]
    for (ax, ay), (bx, by) in pairwise(points):
        if abs(ax - bx) < 0.5:
            path.append(f"L{bx:.1f} {by:.1f}")
            continue
        middle = (ay + by) / 2
        path.append(f"C{ax:.1f} {middle:.1f} {bx:.1f} {middle:.1f} {bx:.1f} {by:.1f}")
    return " ".join(path)


def _begin(box: StateBox, x: float, y: float) -> str:
    """Return the dot from which the machine begins, in the space left of its box."""
    left = x - _box_width(box) / 2
    return (
        f'<circle cx="{left - _ENTRY + 6:.1f}" cy="{y:.1f}" r="5" fill="#33414e"/>'
        f'<path class="edge" d="M{left - _ENTRY + 11:.1f} {y:.1f} L{left:.1f} {y:.1f}" {_MARKED}/>'
    )


def _box(box: StateBox, x: float, y: float) -> str:
    width = _box_width(box)
    start, _, end = box.flight.partition(" → ")
    kind = "phase" if not box.flight else start if start == end else "change"
    kind = "implied" if box.is_built_in else "asker" if box.is_asker else kind
    return (
        f'<rect class="box {kind}" x="{x - width / 2:.1f}" y="{y - _HEIGHT / 2:.1f}" '
        f'width="{width:.1f}" height="{_HEIGHT:.0f}" rx="9"/>'
        + _text(x, y - 3, box.name, "name")
        + _text(x, y + 14, _caption(box), "part")
    )


def _loop(edge: Edge, box: StateBox, x: float, y: float) -> str:
    right = x + _box_width(box) / 2
    path = f"M{right:.1f} {y - 9:.1f} C{right + 30:.1f} {y - 9:.1f} "
    path += f"{right + 30:.1f} {y + 9:.1f} {right:.1f} {y + 9:.1f}"
    line = f'<path class="edge" d="{path}" {_MARKED}/>'
    return line + _label(edge.labels, right + 28, y, "label")


def _label(labels: Sequence[str], x: float, y: float, style: str) -> str:
    top = y - _LINE * (len(labels) - 1) / 2 + 4
    return "".join(
        _text(x, top + number * _LINE, label, style) for number, label in enumerate(labels)
    )


def _text(x: float, y: float, text: str, style: str, more: str = "") -> str:
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" {more}>{escape(text)}</text>'
