"""A laboratory's own library, found through its entry point."""

from __future__ import annotations

from pathlib import Path

import pytest
from installed_package import package
from toolchain import compiled

from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.resolving.library_files import installed
from kybflow.parts.catalog import load_catalog

MISSION = """
kybflow: 1
mission: m
import: {{lab: {name}/quads}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}}}
vehicles:
  a: {{like: lab.quad, behaviors: {{up: {{do: take_off, height: 1 m}}}}}}
"""
LIBRARY = """
library: quads
import: {std: kybflow/airframes}
airframes: {quad: {like: std.mk_quadro, mass: 2 kg}}
vehicles: {quad: {airframe: quad}}
"""


def test_a_library_of_a_package_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(tmp_path / "site", "kyblab", LIBRARY)
    monkeypatch.syspath_prepend(tmp_path / "site")
    plan = compiled(tmp_path / "mission.yaml", MISSION.format(name="kyblab"))
    assert plan.vehicles[0].airframe.mass == 2.0


def test_a_package_that_is_gone_is_no_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(tmp_path / "site", "kybgone", None)
    monkeypatch.syspath_prepend(tmp_path / "site")
    mission = tmp_path / "mission.yaml"
    mission.write_text(MISSION.format(name="kybgone"))
    (finding, *_) = compile_mission(mission, catalog=load_catalog()).diagnostics
    assert finding.code == "KYB120"


def test_the_standard_library_is_at_hand() -> None:
    home = installed("kybflow")
    assert home is not None
    assert (home / "defaults.yaml").is_file()
