"""The figures of one estimator in a report: how far it was off, and how old its estimate was."""

from __future__ import annotations

from typing import Any

import numpy as np

from kybflow.core.units import DEG
from kybflow.report.data import Run
from kybflow.report.estimators import SURE, Array, Estimated
from kybflow.report.plot import Figure, dashed, line, over_time

MOST = 3000
"""The most points of a curve here."""
_USED = "rgba(31,158,119,0.16)"
_AXES = (("x", "#2f7ed8"), ("y", "#e07b26"), ("z", "#a55ec4"))


def is_simulated(run: Run) -> bool:
    """Whether the truth is known."""
    return run.mission.get("simulated") is not False


def error_figure(run: Run, estimated: Estimated, name: str) -> Figure:
    """How far it was off, and how far it believed that it might be."""
    kept = slice(None, None, max(1, -(-len(estimated.time) // MOST)))
    time, bound = estimated.time[kept], SURE * estimated.spread[kept] * 100.0
    off, each = estimated.off[kept] * 100.0, estimated.error[kept] * 100.0
    traces = [line("off", time, off, "#d1495b", 1.6, hover="%{y:.2f} cm")]
    limit = dashed(f"{SURE:.1f} spreads", time, bound, True)
    limit |= {"hoverinfo": "all", "hovertemplate": f"%{{y:.2f}} cm<extra>{limit['name']}</extra>"}
    traces.append({**limit, "legendgroup": name})
    for number, (axis, colour) in enumerate(_AXES):
        trace = line(axis, time, each[:, number], colour, 1.1, hover="%{y:.2f} cm")
        traces.append({**trace, "visible": "legendonly"})
    truth = "the truth" if is_simulated(run) else "what the vehicle flew on"
    note = f"From {truth}, and what 95 % of it is below if the spread is honest. Shaded: in use."
    layout = over_time(run, "off (cm)", "normal")
    highest = _highest(estimated.used[kept], off, bound)
    if highest > 0.0:
        layout["yaxis"]["range"] = [0.0, 1.15 * highest]
        note += " Click x, y or z for one axis; double-click for all of it."
    return Figure(f"{name}_error", "Error and spread", note, traces, layout | _shade(estimated))


def attitude_figure(run: Run, estimated: Estimated, name: str) -> Figure:
    """How far its attitude was off, in all and about the world's z axis."""
    kept = slice(None, None, max(1, -(-len(estimated.time) // MOST)))
    time, turn, yaw = (
        values[kept]
        for values in (estimated.time, estimated.turn / DEG, np.abs(estimated.yaw) / DEG)
    )
    traces = [
        line("attitude", time, turn, "#d1495b", 1.4, hover="%{y:.2f} deg"),
        line("yaw", time, yaw, "#2f7ed8", 1.4, hover="%{y:.2f} deg"),
    ]
    layout = over_time(run, "off (deg)", "tozero") | {"height": 240}
    truth = "the truth" if is_simulated(run) else "what the vehicle flew on"
    note = f"From {truth}: the angle between the two attitudes, and between their headings."
    return Figure(f"{name}_attitude", "Attitude", note, traces, layout | _shade(estimated))


def age_figure(run: Run, estimated: Estimated, name: str) -> Figure:
    kept = slice(None, None, max(1, -(-len(estimated.time) // MOST)))
    time, age = estimated.time[kept], estimated.age[kept] * 1000.0
    traces = [line("age", time, age, "#2f7ed8", 1.4, hover="%{y:.0f} ms")]
    layout = over_time(run, "age (ms)", "tozero") | {"height": 200, "showlegend": False}
    note = "How old its newest measurement was."
    shapes = _shade(estimated).get("shapes", [])
    return Figure(f"{name}_age", "Age", note, traces, layout | {"shapes": shapes})


def _highest(used: Any, off: Array, bound: Array) -> float:
    """The largest error while it was in use, or the largest bound but for a hundredth of them."""
    errors, bounds = (values[used & np.isfinite(values)] for values in (off, bound))
    common = float(np.quantile(bounds, 0.99)) if len(bounds) else 0.0
    return max(common, float(errors.max(initial=0.0)))


def _shade(estimated: Estimated) -> dict[str, Any]:
    """When it was in use, as part of a layout."""
    shapes = [
        {
            "type": "rect",
            "layer": "below",
            "xref": "x",
            "yref": "paper",
            "x0": start,
            "x1": end,
            "y0": 0,
            "y1": 1,
            "line": {"width": 0},
            "fillcolor": _USED,
            "name": "in use",
            "legendgroup": "in use",
            "showlegend": number == 0,
        }
        for number, (start, end) in enumerate(estimated.spans())
    ]
    return {"shapes": shapes, "showlegend": True} if shapes else {}
