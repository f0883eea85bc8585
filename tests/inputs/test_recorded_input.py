"""What a person does is written down, and read back as a script."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from plans import part
from toolchain import MISSIONS, invoke

from kybflow.api.recorded_input import InputUnknown, input_named, record_input
from kybflow.core.errors import DriverError
from kybflow.core.files import File
from kybflow.core.signals import NS
from kybflow.dsl.plan import InputPlan
from kybflow.inputs.rows import parse
from kybflow.inputs.script import Script, ScriptParams
from kybflow.parts import InputLink
from kybflow.parts.input import SticksOf
from kybflow.runtime.clock import SimulatedClock

MISSION = MISSIONS / "teleoperation.yaml"
TEXT = "t,x,buttons,lost\n0,0,,\n1,0.5,a,\n2,,,unplugged\n3,0.25,,\n"


def input_plan(name: str = "stick", cls: type[Script] = Script, **more: Any) -> InputPlan:
    """An input that reads TEXT."""
    script = part("inputs", "script", file=File("operator.csv", "1", TEXT))
    facts = {"button_names": {}, "silent_after": 0.3, **more}
    return InputPlan(name=name, part=dataclasses.replace(script, cls=cls), **facts)


def test_a_table_holds_what_was_done_by_the_missions_names(tmp_path: Path) -> None:
    plan = input_plan(button_names={"a": "leave"})
    out, shown = tmp_path / "mine.csv", list[float]()
    rows = record_input(plan, out, 5.0, lambda now, *_: shown.append(now / NS), SimulatedClock(250))
    said = parse(out.read_text(encoding="utf-8"))
    assert (rows, said.axes, said.buttons) == (5, ("x",), ("leave",))
    assert shown == pytest.approx([0.0, 1.0, 2.0, 3.0, 5.0], abs=0.01)
    assert [row.lost for row in said.rows] == ["", "", "unplugged", "", "the record ended"]


def test_a_device_that_cannot_be_opened_leaves_an_earlier_table(tmp_path: Path) -> None:
    class Unplugged(Script):
        @classmethod
        def open(cls, params: ScriptParams, sticks_of: SticksOf) -> InputLink:
            raise DriverError("no device")

    plan = input_plan(cls=Unplugged)
    out = tmp_path / "mine.csv"
    out.write_text(TEXT, encoding="utf-8")
    with pytest.raises(DriverError, match="no device"):
        record_input(plan, out, 1.0, lambda *_: None, SimulatedClock(250))
    assert out.read_text(encoding="utf-8") == TEXT


def test_the_only_input_needs_no_name() -> None:
    from plans import plan, vehicle
    from short_flights import down, up

    one, other = input_plan("one"), input_plan("other")
    flier = vehicle("a", [up("down"), down()])
    assert one is input_named(plan(flier, inputs=(one,)), None)
    assert other is input_named(plan(flier, inputs=(one, other)), "other")
    for inputs, name, reason in (
        ((), None, "no inputs"),
        ((one, other), None, "several inputs: one, other"),
        ((one,), "oen", "did you mean `one`"),
    ):
        with pytest.raises(InputUnknown, match=reason):
            input_named(plan(flier, inputs=inputs), name)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--for", "10ms"], 0, "rows in"),
        (["operator_stik", "--for", "10ms"], 2, "did you mean `operator_stick`"),
        (["--for", "10m"], 2, "duration"),
    ],
)
def test_the_command_says_what_it_did(
    arguments: list[str], code: int, said: str, tmp_path: Path
) -> None:
    out = ["--out", str(tmp_path / "mine.csv")]
    result = invoke("record-input", MISSION, *arguments, *out)
    assert code == result.exit_code, result.output
    assert said in result.output


def test_a_table_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    out = ["--for", "10ms", "--out", str(tmp_path / "no" / "mine.csv")]
    result = invoke("record-input", MISSION, *out)
    assert result.exit_code == 1
    assert "can't be written" in result.output
