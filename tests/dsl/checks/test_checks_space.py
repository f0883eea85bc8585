"""A mission without a fence is told so once, and flies."""

from __future__ import annotations

from pathlib import Path

from toolchain import invoke, result_of

from kybflow.dsl.diagnostics import Severity

MISSION = """kybflow: 1
mission: free
import: {std: kybflow/airframes}
vehicles:
  station: {like: std.mk_quadro, start: {at: [3, 3, 0]}, behaviors: {rest: {do: wait_on_ground}}}
  a: {like: std.mk_quadro, behaviors: {up: {do: take_off, height: 1 m}}}
  b: {like: a, start: {at: [1, 0, 0]}}
"""


def test_the_warning_is_told_once_and_keeps_nothing_on_the_ground(tmp_path: Path) -> None:
    mission = tmp_path / "free.yaml"
    result = result_of(mission, MISSION)
    [warning] = result.diagnostics
    assert (warning.code, warning.severity, warning.span.line) == ("KYB322", Severity.WARNING, 6)
    assert warning.notes == ("the same is true of `b`",)
    assert result.plan is not None
    assert invoke("validate", mission).exit_code == 0


def test_what_never_flies_needs_no_fence(tmp_path: Path) -> None:
    text = "".join(MISSION.splitlines(keepends=True)[:5])
    assert result_of(tmp_path / "free.yaml", text).diagnostics == ()
