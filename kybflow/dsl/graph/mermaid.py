"""Write the drawings of state machines as text for Mermaid."""

from __future__ import annotations

from kybflow.dsl.graph.drawing import Drawing, drawings
from kybflow.dsl.plan import Plan


def mermaid(plan: Plan) -> str:
    """Return the state machines as one `stateDiagram-v2`, each in its own box."""
    lines = ["---", f"title: {plan.mission}", "---", "stateDiagram-v2"]
    for number, drawing in enumerate(drawings(plan), start=1):
        lines += _box(f"m{number}", drawing)
    return "\n".join(lines) + "\n"


def _box(prefix: str, drawing: Drawing) -> list[str]:
    ids = {box.name: f"{prefix}s{number}" for number, box in enumerate(drawing.boxes, start=1)}
    lines = [f'  state "{drawing.title}" as {prefix} {{', f"    [*] --> {ids[drawing.begin]}"]
    for box in drawing.boxes:
        label = _escaped(f"{box.name}<br>{box.part}{', ' if box.flight else ''}{box.flight}")
        lines.append(f'    state "{label}" as {ids[box.name]}')
    for edge in drawing.edges:
        label = "asks" if edge.is_request else _escaped("<br>".join(edge.labels))
        lines.append(f"    {ids[edge.source]} --> {ids[edge.target]} : {label}")
    built_in = ",".join(ids[box.name] for box in drawing.boxes if box.is_built_in)
    lines.append("  }")
    asking = ",".join(ids[box.name] for box in drawing.boxes if box.is_asker)
    if asking:
        lines += [
            f"  classDef asks{prefix} fill: #efe9f6, stroke: #8468ad, stroke-dasharray: 2",
            f"  class {asking} asks{prefix}",
        ]
    if built_in:
        lines += [
            f"  classDef builtIn{prefix} stroke-dasharray: 4, fill: none",
            f"  class {built_in} builtIn{prefix}",
        ]
    return lines


def _escaped(text: str) -> str:
    """Return text for a label of Mermaid, in which only our line breaks remain markup."""
    escapes = {"#": "#35;", '"': "#quot;", "<": "#lt;", ">": "#gt;", ":": "#58;", ";": "#59;"}
    return "<br>".join("".join(escapes.get(c, c) for c in line) for line in text.split("<br>"))
