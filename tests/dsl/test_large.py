"""A mission of 5,000 lines with ten imports, as `bench/large.py` times it, is understood."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from toolchain import ROOT

from kybflow.dsl.compiler import check_mission
from kybflow.parts.catalog import load_catalog

BENCH = ROOT / "bench"


def test_it_has_no_findings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCH)
    path = importlib.import_module("large").write(tmp_path, 5000)[0]
    assert len(path.read_text().splitlines()) >= 5000
    assert check_mission(path, catalog=load_catalog()).diagnostics == ()
