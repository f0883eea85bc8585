"""What newcomers do wrong, written as they write it: each is told at the line where they have to
look, with a way out.

A mistake is what it replaces in a good mission. `#!` marks the lines at which a report of it is
right; it is taken away before the mission is read. What depends on when each vehicle is where, the
rehearsal tells.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from toolchain import result_of

from kybflow.api.rehearsal.rehearse import rehearse
from kybflow.dsl.diagnostics import Diagnostic

ONE = """\
kybflow: 1
mission: hop
import: {std: kybflow/airframes}
world:
  fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}
vehicles:
  nano:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: go, within: 15 s}
      go:   {do: fly_to, position: [1, 0, 1], speed: 0.5 m/s, then: hold, within: 20 s}
      hold: {do: hover, for_time: 3 s, then: down}
      down: {do: land}
expect:
  - max(nano.position_error in hold) < 10 cm
  - finally nano in landed
  - finished within 40 s
"""
TWO = """\
kybflow: 1
mission: pair
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [-1, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: go}
      go:   {do: fly_to, position: [-1, 1, 1], then: down}
      down: {do: land}
  b:
    like: std.nano_plus
    start: {at: [1, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: go}
      go:   {do: fly_to, position: [1, 1, 1], then: down}
      down: {do: land}
"""
UP = "      up:   {do: take_off, height: 1 m, then: go, within: 15 s}\n"
GO = "      go:   {do: fly_to, position: [1, 0, 1], speed: 0.5 m/s, then: hold, within: 20 s}\n"
HOLD = "      hold: {do: hover, for_time: 3 s, then: down}\n"
DOWN = "      down: {do: land}\n"
START = "    start: {at: [0, 0, 0]}\n"
LIKE = "    like: std.nano_plus\n"
FENCE = "  fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}\n"
ERROR = "  - max(nano.position_error in hold) < 10 cm\n"
FINISHED = "  - finished within 40 s\n"
GO_A = "      go:   {do: fly_to, position: [-1, 1, 1], then: down}\n"
GO_B = "      go:   {do: fly_to, position: [1, 1, 1], then: down}\n"


def at(line: str) -> str:
    """A line at which a report is right."""
    return line.replace("\n", "#!\n")


def leaving(way: str) -> str:
    """The hover with a way out of the newcomer's own."""
    return at(HOLD.replace("then", f"next: [{{{way}, go: down}}], then"))


class Mistake(NamedTuple):
    """old, new: what it replaces and by what; more: another such pair."""

    name: str
    old: str
    new: str
    mission: str = ONE
    more: tuple[str, str] = ("", "")

    @property
    def marked(self) -> str:
        assert self.old in self.mission, self.name
        text = self.mission.replace(self.old, self.new, 1)
        return text.replace(*self.more, 1) if self.more[0] else text


TOLD = [
    Mistake("decimal comma in a point", GO, GO.replace("[1, 0, 1]", "[1,2, 0, 1]#!")),
    Mistake("an angle without a unit", GO, GO.replace("speed", "heading: 90, speed#!")),
    Mistake("a speed in metres", GO, GO.replace("0.5 m/s", "0.5 m#!")),
    Mistake("a time in metres", HOLD, HOLD.replace("3 s", "3 m#!")),
    Mistake("a unit that is none", HOLD, HOLD.replace("3 s", "3 sec#!")),
    Mistake("a brace is not closed", HOLD, HOLD.replace("}", "#!"), more=(DOWN, at(DOWN))),
    Mistake("a bracket is not closed", GO, GO.replace("[1, 0, 1]", "[1, 0, 1#!")),
    Mistake("round brackets for a point", GO, GO.replace("[1, 0, 1]", "(1, 0, 1)#!")),
    Mistake("a tab for spaces", HOLD, f"\t{HOLD.strip()}#!\n"),
    Mistake("one space too few", HOLD, f"     {HOLD.strip()}#!\n"),
    Mistake("one space too many", HOLD, f"       {HOLD.strip()}#!\n"),
    Mistake("no space behind the colon", HOLD, HOLD.replace("do: hover", "do:hover#!")),
    Mistake("no colon behind a name", DOWN, "      down {do: land}#!\n"),
    Mistake("another case of a part", DOWN, "      down: {do: Land}#!\n"),
    Mistake("another case of a key", LIKE, "    Like: std.nano_plus#!\n"),
    Mistake("camel case of a part", UP, UP.replace("take_off", "takeOff#!")),
    Mistake("a part of another program", UP, UP.replace("take_off", "takeoff#!")),
    Mistake("a behavior that isn't there", HOLD, HOLD.replace("then: down", "then: land_now#!")),
    Mistake("a misspelt parameter", UP, UP.replace("height", "altitude#!")),
    Mistake("a parameter left out", UP, UP.replace("height: 1 m, ", "#!")),
    Mistake("an unknown airframe", LIKE, "    like: std.crazyflie#!\n"),
    Mistake("a missing import", "import: {std: kybflow/airframes}\n", "", more=(LIKE, at(LIKE))),
    Mistake("an import of no file", "kybflow/airframes}", "airframes.yaml}#!"),
    Mistake("two numbers for a place", GO, GO.replace("[1, 0, 1]", "[1, 0]#!")),
    Mistake("a goal outside of the fence", GO, GO.replace("[1, 0, 1]", "[5, 0, 1]#!")),
    Mistake("a goal below the floor", GO, GO.replace("[1, 0, 1]", "[1, 0, -1]#!")),
    Mistake("higher than the fence", UP, UP.replace("1 m", "4 m#!")),
    Mistake(
        "a fence too low", FENCE, FENCE.replace("2.5]}", "0.8]}#!"),
        more=("height: 1 m", "height: 1 m#!"),
    ),
    Mistake("a start outside of the fence", START, START.replace("[0, 0, 0]", "[9, 0, 0]#!")),
    Mistake("a start in the air", START, START.replace("[0, 0, 0]", "[0, 0, 1]#!")),
    Mistake("no land at the end", HOLD, HOLD.replace("then: down", "then: up#!")),
    Mistake(
        "nothing leads to the landing", HOLD, HOLD.replace(", then: down", "#!"),
        more=(DOWN, at(DOWN)),
    ),
    Mistake("a hover without an end", HOLD, HOLD.replace("for_time: 3 s, ", "#!")),
    Mistake("takes off in the air", GO, GO.replace("then: hold", "then: up#!")),
    Mistake("no take-off", UP, at(UP).replace("take_off, height: 1 m", "hover")),
    Mistake("a comma in a condition", HOLD, leaving("when: distance(nano, nano.start) > 1 m")),
    Mistake("one equals sign", HOLD, leaving("when: estimator = mocap")),
    Mistake("a condition without a unit's sense", HOLD, leaving("when: state.altitude > 3 s")),
    Mistake("the battery as a number", HOLD, leaving("when: battery < 30 %")),
    Mistake("an event that nobody tells", HOLD, leaving("event: arrived")),
    Mistake(
        "an expectation about a stranger", ERROR,
        "  - max(drone.position_error in hold) < 10 cm#!\n",
    ),
    Mistake(
        "an expectation in a state that isn't there", ERROR, at(ERROR.replace("hold", "holding")),
    ),
    Mistake("an expectation without a bound", ERROR, "  - max(nano.position_error in hold)#!\n"),
    Mistake("no fence", f"world:\n{FENCE}", "", more=("  nano:\n", "  nano:#!\n")),
    Mistake("a key twice", START, f"{START}    start: {{at: [1, 0, 0]}}#!\n"),
    Mistake("two vehicles at one start", "[1, 0, 0]}", "[-1, 0, 0]}#!", TWO),
    Mistake(
        "two vehicles land in one place", GO_B + DOWN,
        at(GO_B.replace("[1, 1, 1]", "[-1, 1, 1]")) + at(DOWN), TWO,
    ),
    Mistake(
        "a vehicle of another name", "  b:", "  b:", TWO,
        (GO_B, GO_B.replace("then: down", "next: [{when: c in landed, go: down}], then: down#!")),
    ),
    Mistake("faster than its airframe", GO, GO.replace("0.5 m/s", "50 m/s#!")),
    Mistake("an opening bracket for a brace", DOWN, "      down: [do: land]#!\n"),
    Mistake(
        "a list of the wrong thing", "expect:\n", "expect: max(nano.position_error) < 10 cm#!\n",
        more=(ERROR + "  - finally nano in landed\n" + FINISHED, ""),
    ),
    Mistake("decimal comma", UP, UP.replace("1 m", "1,5 m#!")),
    Mistake("decimal comma in a speed", GO, GO.replace("0.5 m/s", "1,5 m/s#!")),
    Mistake("a forgotten colon behind within", UP, UP.replace("within: 15 s", "within 15 s#!")),
    Mistake("a forgotten colon behind then", UP, UP.replace("then: go", "then go#!")),
    Mistake("milliseconds for seconds", UP, UP.replace("15 s", "15 ms#!")),
    Mistake("a way that takes longer than it may", GO, GO.replace("20 s", "1 s#!")),
    Mistake("longer than the battery lasts", HOLD, HOLD.replace("3 s", "40 min#!")),
    Mistake("finished sooner than it can be", FINISHED, "  - finished within 4 s#!\n"),
    Mistake("centimetres for metres", UP, UP.replace("1 m", "1 cm#!")),
    Mistake("radians for degrees", START, START.replace("}", ", heading: 90 rad}#!")),
    Mistake("an error of a kilometre", ERROR, at(ERROR.replace("10 cm", "1 km"))),
    Mistake("an error in metres", ERROR, at(ERROR.replace("10 cm", "10"))),
    Mistake("a condition above the ceiling", HOLD, leaving("when: state.altitude > 40 m")),
    Mistake("a hover that is over at once", HOLD, leaving("when: state.altitude < 40 m")),
    Mistake(
        "no landing of a low battery", START,
        f"{START}    supervisors: [{{use: battery, land_below: 0 %}}]#!\n",
    ),
    Mistake(
        "rotors off for a low battery", START,
        f"{START}    supervisors: [{{use: battery, reaction: cut}}]#!\n",
    ),
]  # fmt: skip
REHEARSED = [
    Mistake(
        "head-on", GO_A, GO_A.replace("[-1, 1, 1]", "[1, 0, 1]#!"), TWO,
        (GO_B, GO_B.replace("[1, 1, 1]", "[-1, 0, 1]#!")),
    ),
    Mistake(
        "both at one place in the air",
        GO_B,
        GO_B.replace("[1, 1, 1], then: down", "[-1, 1, 1], then: home#!").replace(
            "\n", "\n      home: {do: fly_to, position: [1, 0, 1], then: down}\n"
        ),
        TWO,
        (GO_A, at(GO_A)),
    ),
]  # fmt: skip
"""What depends on when each vehicle is where."""


def told(mistake: Mistake, folder: Path) -> tuple[list[Diagnostic], set[int]]:
    """What is told at a right line, and the right lines."""
    marked = mistake.marked.split("\n")
    lines = {n for n, line in enumerate(marked, 1) if "#!" in line}
    path = folder / "mission.yaml"
    found = result_of(path, "\n".join(line.replace("#!", "") for line in marked)).diagnostics
    return [d for d in found if d.span.file == str(path) and d.span.line in lines], lines


@pytest.mark.parametrize("mission", [ONE, TWO])
def test_without_a_mistake_nothing_is_told(mission: str, tmp_path: Path) -> None:
    assert result_of(tmp_path / "mission.yaml", mission).diagnostics == ()


@pytest.mark.parametrize("mistake", TOLD, ids=lambda m: m.name)
def test_a_mistake_is_told_at_its_line_with_a_way_out(mistake: Mistake, tmp_path: Path) -> None:
    found, lines = told(mistake, tmp_path)
    assert lines
    assert found
    assert any(d.help or d.notes or d.label for d in found)


@pytest.mark.parametrize("mistake", REHEARSED, ids=lambda m: m.name)
def test_a_mistake_in_time_is_told_by_the_rehearsal(mistake: Mistake, tmp_path: Path) -> None:
    found, lines = told(mistake, tmp_path)
    assert found == []

    result = result_of(tmp_path / "mission.yaml")
    assert result.plan is not None
    rehearsal = rehearse(result.plan, texts=result.texts)
    assert {d.span.line for d in rehearsal.diagnostics} == lines
    assert all(d.help and d.notes for d in rehearsal.diagnostics)
