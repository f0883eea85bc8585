"""Imports, `like` and parameters, by what they leave in the plan."""

from __future__ import annotations

from pathlib import Path

import pytest
from installed_package import package
from toolchain import compiled, result_of

from kybflow.dsl.compiler import Result
from kybflow.dsl.expressions import describe
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.dsl.resolving.library_files import installed
from kybflow.parts.catalog import load_catalog

BEHAVIORS = "behaviors: {up: {do: take_off, height: $height, then: down}, down: {do: land}}"
MISSION = f"""
kybflow: 1
mission: m
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-9, -9, 0], to: [9, 9, 9]}}}}
parameters:
  height: {{type: length, default: 1 m, at_most: 2 m}}
vehicles:
  a: {{like: std.mk_quadro, {BEHAVIORS}}}
"""


def checked(folder: Path, text: str, *sets: str, **files: str) -> Result:
    for name, body in files.items():
        (folder / f"{name}.yaml").write_text(body)
    return result_of(folder / "mission.yaml", text, sets=sets)


def plan_of(folder: Path, text: str, *sets: str, **files: str) -> Plan:
    result = checked(folder, text, *sets, **files)
    assert [d.message for d in result.diagnostics] == []
    assert result.plan is not None
    return result.plan


def vehicle(plan: Plan, name: str) -> VehiclePlan:
    return next(v for v in plan.vehicles if v.name == name)


def height(plan: Plan) -> float:
    value: float = plan.vehicles[0].states["up"].behavior.params.height
    return value


def test_the_default_counts_until_a_setting_does(tmp_path: Path) -> None:
    assert height(plan_of(tmp_path, MISSION)) == 1.0
    assert height(plan_of(tmp_path, MISSION, "height=150 cm")) == 1.5


@pytest.mark.parametrize(
    ("setting", "code"),
    [
        ("height=3 m", "KYB105"),
        ("height=3 s", "KYB104"),
        ("height=[1, 2, 3]", "KYB104"),
        ("height={a: 1}", "KYB135"),
        ("heigth=3 m", "KYB131"),
        ("height", "KYB135"),
        ("height=", "KYB135"),
        ("=3", "KYB135"),
    ],
)
def test_a_wrong_setting_is_shown_where_it_was_given(
    tmp_path: Path, setting: str, code: str
) -> None:
    (finding,) = checked(tmp_path, MISSION, setting).diagnostics
    assert (finding.code, finding.span.file) == (code, "--set")


def test_every_vehicle_has_the_defaults(tmp_path: Path) -> None:
    a = vehicle(plan_of(tmp_path, MISSION), "a")
    assert [e.part.name for e in a.estimators] == ["mocap"]
    assert "fence" in [p.name for p in a.processors]
    assert a.tracker.name == "geometric"
    assert a.estimators[0].part.at.endswith("defaults.yaml:7")


def test_always_present_supervisors_are_added_once(tmp_path: Path) -> None:
    always = [spec.name for spec in load_catalog().always("supervisors")]
    text = MISSION.replace("like: std.mk", f"supervisors: [{always[-1]}], like: std.mk")
    assert sorted(s.name for s in vehicle(plan_of(tmp_path, text), "a").supervisors) == sorted(
        always
    )


def test_mappings_merge_lists_are_replaced_null_removes(tmp_path: Path) -> None:
    text = (
        MISSION
        + """
  b:
    like: a
    start: {at: [0, 2, 0]}
    processors: [fence]
    airframe: {mass: 1.5 kg}
    behaviors:
      up: {then: null, height: 50 cm}
      down: null
"""
    )
    plan = plan_of(tmp_path, text)
    a, b = vehicle(plan, "a"), vehicle(plan, "b")
    assert [p.name for p in b.processors] == ["fence"]
    assert (b.airframe.mass, b.airframe.thrust) == (1.5, a.airframe.thrust)
    assert b.states["up"].behavior.params.height == 0.5
    assert [(t.target, t.implied) for t in b.states["up"].transitions if t.cause == "then"] == [
        ("brake", True)
    ]
    assert "down" not in b.states


def test_naming_another_airframe_replaces_it(tmp_path: Path) -> None:
    text = MISSION.replace("like: std.mk_quadro", "like: std.mk_quadro, airframe: std.nano_plus")
    assert vehicle(plan_of(tmp_path, text), "a").airframe.mass == 0.23


def test_inherited_states_may_stay_unused(tmp_path: Path) -> None:
    text = (
        MISSION
        + """
  b: {like: a, start: {at: [0, 2, 0]}, begin: rest, behaviors: {rest: {do: wait_on_ground}}}
"""
    )
    assert vehicle(plan_of(tmp_path, text), "b").begin == "rest"


def test_parameters_stand_inside_of_conditions_and_expectations(tmp_path: Path) -> None:
    text = MISSION.replace(
        "parameters:",
        "parameters:\n  goal: {type: position, default: [1, -2 m, 50 cm]}\n"
        "  tolerance: {type: length, default: 3 cm}",
    )
    text += "expect: [finally distance(a to $goal) < $tolerance]\n"
    plan = plan_of(tmp_path, text)
    expectation = plan.expectations[0]
    assert describe(expectation.expression) == "finally distance(a to [1 -2 0.5]) < 3 cm"
    assert expectation.text == "finally distance(a to $goal) < $tolerance"


def test_an_alias_is_a_value_in_one_place_and_an_expression_in_another(tmp_path: Path) -> None:
    text = MISSION.replace("mission: m", "mission: m\nsummary: &s a $height")
    (finding,) = checked(tmp_path, text + "expect: [*s]\n").diagnostics
    assert (finding.code, finding.message) == (
        "KYB210",
        "found `1 m` where a comparison such as `<` should be",
    )


def test_an_airframe_may_start_from_another_in_its_place(tmp_path: Path) -> None:
    text = MISSION.replace("like: std.mk_quadro", "airframe: {like: std.nano_plus, mass: 300 g}")
    airframe = vehicle(plan_of(tmp_path, text), "a").airframe
    assert (airframe.mass, airframe.diameter) == (0.3, 0.19)


def test_names_in_a_library_are_its_own(tmp_path: Path) -> None:
    lab = """
library: lab
import: {base: kybflow/airframes}
parameters: {weight: {type: mass, default: 1 kg}}
airframes: {quad: {like: base.mk_quadro, mass: $weight}}
vehicles: {quad: {airframe: quad}}
"""
    text = MISSION.replace(
        "std: kybflow/airframes", "std: {from: lab.yaml, with: {weight: 1.5 kg}}"
    )
    text = text.replace("std.mk_quadro", "std.quad")
    assert vehicle(plan_of(tmp_path, text, lab=lab), "a").airframe.mass == 1.5


def test_one_library_may_be_reached_twice(tmp_path: Path) -> None:
    one = "library: one\nimport: {std: kybflow/airframes}\nvehicles: {q: {like: std.mk_quadro}}\n"
    text = MISSION.replace("{std:", "{one: one.yaml, std:").replace("std.mk_quadro", "one.q")
    text += f"  b: {{like: std.mk_quadro, start: {{at: [2, 0, 0]}}, {BEHAVIORS}}}\n"
    assert vehicle(plan_of(tmp_path, text, one=one), "a").airframe.mass == 1.05


def test_a_target_may_replace_the_driver(tmp_path: Path) -> None:
    text = (
        MISSION
        + """
targets:
  calm: {all: {driver: {use: sim, model_error: 0 %}}}
"""
    )
    plan = compiled(tmp_path / "mission.yaml", text, target="calm")
    assert plan.vehicles[0].driver.params.model_error == 0.0
    assert plan.simulated


def test_within_goes_to_failed(tmp_path: Path) -> None:
    text = MISSION.replace("then: down}", "then: down, within: 10 s, failed: auto_land}")
    arrows = vehicle(plan_of(tmp_path, text), "a").states["up"].transitions
    assert [(t.cause, t.target) for t in arrows] == [
        ("then", "down"),
        ("failed", "auto_land"),
        ("within", "auto_land"),
    ]


OF_PACKAGE = """
kybflow: 1
mission: m
import: {{lab: {name}/quads}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}}}
vehicles:
  a: {{like: lab.quad, behaviors: {{up: {{do: take_off, height: 1 m}}}}}}
"""
QUADS = """
library: quads
import: {std: kybflow/airframes}
airframes: {quad: {like: std.mk_quadro, mass: 1.5 kg}}
vehicles: {quad: {airframe: quad}}
"""


def test_a_library_of_a_package_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(tmp_path / "site", "kyblab", QUADS)
    monkeypatch.syspath_prepend(tmp_path / "site")
    plan = compiled(tmp_path / "mission.yaml", OF_PACKAGE.format(name="kyblab"))
    assert plan.vehicles[0].airframe.mass == 1.5


def test_a_package_that_is_gone_is_no_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(tmp_path / "site", "kybgone", None)
    monkeypatch.syspath_prepend(tmp_path / "site")
    result = checked(tmp_path, OF_PACKAGE.format(name="kybgone"))
    assert result.diagnostics[0].code == "KYB120"


def test_the_standard_library_is_at_hand() -> None:
    home = installed("kybflow")
    assert home is not None
    assert (home / "defaults.yaml").is_file()
