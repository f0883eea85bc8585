"""A plain key of the language is one line: in a copy of the package, one line is added to each of
several records, and the schema, the docs, completion, the resolved text and the plan know it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import kybflow

ROOT = Path(__file__).parents[3]


class Added(NamedTuple):
    """A key that is added, and what follows from it.

    record: its title in the docs. file, after: where the line goes. written, value: what a mission
    says, and the value (SI) in the plan; found_by is where the plan has it. said: what its schema's
    description says. bounds: what its schema says besides. offered: what an editor inserts. row: its
    row in the docs, or the beginning of one. wrong: a value that is a finding with this code.
    """

    record: str
    file: str
    after: str
    line: str
    written: str
    value: Any
    found_by: str
    schema: tuple[str, ...]
    said: str
    bounds: dict[str, Any]
    offered: str
    row: str
    wrong: str
    code: str

    @property
    def key(self) -> str:
        return self.line.partition(":")[0]


_IN_FLEET = ("properties", "vehicles", "additionalProperties", "properties")
ADDED = {
    "vehicle": Added(
        record="vehicle",
        file="dsl/plan.py",
        after="    home: Position | None = key(",
        line='elbow_room: Length = key("Kept free around it.", default=0.5, above=0.0, at_most=5.0)',
        written="80 cm",
        value=0.8,
        found_by="plan.fleet['a'].elbow_room",
        schema=(*_IN_FLEET, "elbow_room"),
        said="Kept free around it. Default: 0.5 m. Above 0 m and at most 5 m.",
        bounds={"exclusiveMinimum": 0.0, "maximum": 5.0},
        offered="50 cm",
        row="| `elbow_room` | Kept free around it. | length [m], above 0 m and at most 5 m | `0.5 m` |",
        wrong="9 m",
        code="KYB105",
    ),
    "input": Added(
        record="input",
        file="dsl/plan.py",
        after="    dead_man: str | None = key(",
        line='hand: Literal["left", "right"] = key("The hand that holds it.", default="right")',
        written="left",
        value="left",
        found_by="plan.inputs_by_name['stick'].hand",
        schema=("properties", "inputs", "additionalProperties", "properties", "hand"),
        said="The hand that holds it. Default: right.",
        bounds={"enum": ["left", "right"]},
        offered="left",
        row="| `hand` | The hand that holds it. | left \\| right | `right` |",
        wrong="both",
        code="KYB109",
    ),
    "phase": Added(
        record="phase",
        file="dsl/plan.py",
        after="    arrive: Arrive | None = key(",
        line='patience: Duration | None = key("How long it waits.", default=None, above=0.0)',
        written="1.5 s",
        value=1.5,
        found_by="plan.flows_by_name['team'].phases['launch'].patience",
        schema=(
            "properties", "flows", "additionalProperties", "properties", "phases",
            "additionalProperties", "properties", "patience",
        ),
        said="How long it waits. Above 0 s.",
        bounds={"exclusiveMinimum": 0.0},
        offered="300 ms",
        row="| `patience` | How long it waits. | duration [s], above 0 s |  |",
        wrong="1.5 m",
        code="KYB104",
    ),
    "target": Added(
        record="vehicle's target",
        file="dsl/plan.py",
        after="    driver: Annotated[PartPlan | None, part_of(\"drivers\")] = key(",
        line='spares: int = key("Batteries at hand.", default=1, at_least=0, at_most=9)',
        written="4",
        value=4,
        found_by="plan.targets['sim'].vehicles['a'].spares",
        schema=(
            "properties", "targets", "additionalProperties", "additionalProperties",
            "properties", "spares",
        ),
        said="Batteries at hand. Default: 1. At least 0 and at most 9.",
        bounds={"minimum": 0, "maximum": 9},
        offered="1",
        row="| `spares` | Batteries at hand. | integer, at least 0 and at most 9 | `1` |",
        wrong="12",
        code="KYB105",
    ),
    "option": Added(
        record="",
        file="runtime/behaviors/hover.py",
        after="    for_time: Duration | None = param(",
        line=(
            "stiffness: Annotated[Matrix, Rows(2, 2, LENGTH)] = "
            'param("How it gives way.", default=((1.0, 0.0), (0.0, 1.0)), at_least=0.0)'
        ),
        written="[[2 m, 0], [50 cm, 1]]",
        value=[[2.0, 0.0], [0.5, 1.0]],
        found_by="plan.fleet['a'].states['stay'].behavior.params.stiffness",
        schema=(*_IN_FLEET, "behaviors", "additionalProperties", "allOf", "hover", "stiffness"),
        said="How it gives way. Default: [[1 m, 0 m], [0 m, 1 m]]. At least 0 m.",
        bounds={"minimum": 0.0},
        offered="[[1 m, 0 m], [0 m, 1 m]]",
        row="| `stiffness` | 2 x 2 matrix of length [m] | [[1 m, 0 m], [0 m, 1 m]] | at least 0 m |  | How it gives way. |",
        wrong="[[2 m, 0], [-1 m, 1]]",
        code="KYB105",
    ),
}  # fmt: skip
MISSION = """\
kybflow: 1
mission: one_line
import: {std: library/airframes.yaml}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
inputs:
  stick: {use: keyboard, <input>}
vehicles:
  a:
    like: std.nano_plus
    <vehicle>
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: stay, within: 15 s}
      stay: {do: hover, <option>, next: [{event: stick.space, go: down}], within: 9 s}
      down: {do: land}
flows:
  team:
    phases:
      launch: {run: {a: up}, <phase>, next: [{when: a in landed, go: end}], within: 60 s, otherwise: end}
targets:
  sim: {a: {<target>}}
"""
PROBE = """\
import json, sys
from pathlib import Path
from kybflow.cli.printing.parts import page
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.language.published import mission_schema
from kybflow.dsl.language.schema import record_schema
from kybflow.dsl.language.tables import records, with_tables
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.options import check_options

catalog = load_catalog()
pages = {title: with_tables(f"<!-- keys: {title} -->\\n<!-- end -->") for title in records()}
right = compile_mission("missions/right.yaml", catalog=catalog)
said = {"found": [str(finding) for finding in right.diagnostics]}
if right.plan is not None:
    Path("missions/again.yaml").write_text(right.plan.resolved, encoding="utf-8")
    again = compile_mission("missions/again.yaml", catalog=catalog)
    said["again_found"] = [str(finding) for finding in again.diagnostics]
    values = {name: (right.plan, again.plan) for name in json.loads(sys.argv[1])}
    for name, (plan, other) in values.items():
        said[name] = [eval(name, {"plan": one}) for one in (plan, other)]
"""
