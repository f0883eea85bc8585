"""Nothing is reported of missions that are unusual and right: `good/*.yaml`."""

from __future__ import annotations

from pathlib import Path

import pytest

from kybflow.dsl.compiler import check_mission
from kybflow.dsl.diagnostics import render_all
from kybflow.parts.catalog import load_catalog

GOOD = Path(__file__).parent / "good"


@pytest.mark.parametrize("path", sorted(GOOD.rglob("*.yaml")), ids=lambda path: path.stem)
def test_nothing_is_reported(path: Path) -> None:
    result = check_mission(path, catalog=load_catalog())
    assert not render_all(result.diagnostics, result.texts)
