"""The resolved mission reads back as the same plan."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

from kybflow.catalog import load_catalog
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import ExpectationPlan, Plan

MISSIONS = sorted((Path(__file__).parents[2] / "missions").glob("*.yaml"))


def without_places(value: object) -> object:
    """The plan without `at`, sources and texts: its own, and expectations with `$name`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            f.name: without_places(getattr(value, f.name))
            for f in dataclasses.fields(value)
            if f.name not in ("at", "sources", "resolved")
            and not (f.name == "text" and isinstance(value, ExpectationPlan))
        }
    if isinstance(value, dict):
        return {k: without_places(v) for k, v in value.items()}
    return [without_places(v) for v in value] if isinstance(value, list | tuple) else value


@pytest.mark.parametrize("path", MISSIONS, ids=[p.stem for p in MISSIONS])
def test_it_reads_back_as_the_same_plan(path: Path, tmp_path: Path) -> None:
    first = compile_mission(path, catalog=load_catalog()).plan
    assert isinstance(first, Plan)
    copy = tmp_path / "resolved.yaml"
    copy.write_text(first.resolved)
    shutil.copytree(path.parent / "trajectories", tmp_path / "trajectories")
    for source in (Path(s.path) for s in first.sources if not s.path.endswith(".yaml")):
        beside = tmp_path / source.relative_to(path.parent)
        beside.parent.mkdir(exist_ok=True)
        beside.write_bytes(source.read_bytes())
    result = compile_mission(copy, catalog=load_catalog())
    assert [d.message for d in result.diagnostics] == []
    assert without_places(result.plan) == without_places(first)


def test_each_line_says_where_it_came_from() -> None:
    plan = compile_mission(MISSIONS[0], catalog=load_catalog()).plan
    assert plan is not None
    for line in filter(None, plan.resolved.splitlines()):
        origin = line.rsplit("  # ", 1)[1]
        assert origin == "default" or ".yaml:" in origin
