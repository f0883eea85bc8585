"""Moving an object together: who is waited for, who lets go, and what can't work."""

from __future__ import annotations

from dataclasses import replace

import pytest
from part_bench import BLOCK, DT, SITE, estimate, seen_block

from kybflow.core.signals import NS
from kybflow.parts import TeamMember, TeamTick
from kybflow.runtime.coordinators.move_object import MoveObject, MoveObjectParams

TEAM = {
    name: SITE._replace(
        vehicle=name, airframe=replace(SITE.airframe, bumper=0.12), objects={"block": BLOCK}
    )
    for name in ("a", "b")
}
PUSHES = TeamMember(estimate((0.78, 0.2, 1.0)), "block.back")
WAITS = TeamMember(estimate((0.0, 0.0, 1.0)), None)


def moving() -> MoveObject:
    return MoveObject(MoveObjectParams(object="block", position=0.5), TEAM)


def tick(a: TeamMember, b: TeamMember, age: float = 0.0) -> TeamTick:
    return TeamTick(NS, DT, seen_block(0.0, 0.0, NS - round(age * NS)), {"a": a, "b": b})


def test_whoever_pushes_waits_for_the_others_with_the_preload() -> None:
    shares = moving().update(tick(PUSHES, WAITS))
    assert (dict(shares.values), shares.state) == ({"a": 0.1}, "wait")


def test_all_let_go_when_one_no_longer_pushes() -> None:
    law = moving()
    assert law.update(tick(PUSHES, PUSHES)).state == "align"
    shares = law.update(tick(PUSHES, WAITS))
    assert (dict(shares.values), shares.state) == ({}, "let_go")
    assert shares.reason == "`b` no longer pushes"


def test_all_let_go_when_the_object_is_not_seen() -> None:
    law = moving()
    law.update(tick(PUSHES, PUSHES))
    assert law.update(tick(PUSHES, PUSHES, age=0.3)).state == "let_go"


def test_forces_are_shared_between_those_who_push() -> None:
    law = moving()
    for _ in range(300):
        shares = law.update(tick(PUSHES, PUSHES))
    assert shares.state == "push"
    assert shares.values["a"] == pytest.approx(shares.values["b"])
    assert shares.values["a"] > 0.12


def test_goals_of_other_joints_and_missing_goals_are_refused() -> None:
    def found(**params: object) -> list[str]:
        return [one.parameter for one in MoveObject.objections(MoveObjectParams(**params), TEAM)]  # type: ignore[arg-type]

    assert found(object="block", position=0.5) == []
    assert found(object="block", yaw=0.5, position=0.5) == ["yaw"]
    assert found(object="block") == ["object"]
    assert found(object="blok", position=0.5) == ["object"]
