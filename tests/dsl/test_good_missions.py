"""Nothing is reported of missions that are unusual and right, `good/*.yaml`, or large."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from toolchain import ROOT

from kybflow.dsl.compiler import check_mission
from kybflow.dsl.diagnostics import render_all
from kybflow.parts.catalog import load_catalog

GOOD = Path(__file__).parent / "good"


@pytest.mark.parametrize("path", sorted(GOOD.rglob("*.yaml")), ids=lambda path: path.stem)
def test_nothing_is_reported(path: Path) -> None:
    result = check_mission(path, catalog=load_catalog())
    assert not render_all(result.diagnostics, result.texts)


def test_nothing_is_reported_of_5000_lines_with_ten_imports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(ROOT / "bench")
    path = importlib.import_module("large").write(tmp_path, 5000)[0]
    assert len(path.read_text().splitlines()) >= 5000
    assert check_mission(path, catalog=load_catalog()).diagnostics == ()
