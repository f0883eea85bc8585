"""A drone pushes a cart: contact is inferred soon after it is true, and a stop ends the push."""

from __future__ import annotations

import pytest
from toolchain import SHIPPED, compiled, with_library

from kybflow.api.flight import RunRequest, fly
from kybflow.api.rehearsal.rehearse import rehearse
from kybflow.core.signals import NS, Event

TEXT = next(path for path in SHIPPED if path.stem == "push_cart").read_text(encoding="utf-8")
CALLBACKS = """\
on:
  - {when: drone.contact == cart, do: [{log: touches}]}
  - {when: drone.contact == nothing, do: [{log: touches nothing}]}
"""


def flown(text: str, tmp_path, seed: int = 0) -> tuple[list[Event], dict]:
    plan = compiled(with_library(tmp_path) / "push.yaml", text, warns=True)
    told: list[Event] = []
    return told, fly(plan, RunRequest(seed=seed, out=tmp_path / "run"), (told.append,)).summary


def times(told: list[Event], name: str, **fields: str) -> list[float]:
    found = (e for e in told if e.name == name)
    return [e.time / NS for e in found if fields.items() <= e.fields.items()]


@pytest.mark.thorough
def test_contact_is_inferred_soon_after_it_is_true(tmp_path) -> None:
    told, summary = flown(TEXT + CALLBACKS, tmp_path)
    assert summary["outcome"] == "succeeded"
    began, ended = times(told, "contact_began")[0], times(told, "contact_ended")[-1]
    [noticed] = times(told, "logged", text="touches")
    missed = times(told, "logged", text="touches nothing")[-1]
    assert began < noticed < began + 0.6
    assert ended - 0.1 < missed < ended + 0.5


@pytest.mark.thorough
def test_it_lets_go_in_a_fifth_of_a_second_when_somebody_takes_the_cart_away(tmp_path) -> None:
    hand = "{when: cart.position > 60 cm, on: drone, inject: push_object, object: cart"
    told, _ = flown(f"{TEXT}faults:\n  - {hand}, force: [6 N, 0, 0], for: 0.3 s}}\n", tmp_path)
    [failed] = [e for e in told if e.name == "behavior_failed"]
    assert "lost contact with `cart.back`" in failed.fields["reason"]
    assert failed.time / NS < times(told, "contact_ended")[-1] + 0.2
    assert [e.fields["behavior"] for e in told if e.name == "behavior_started"][-1] == "landed"


@pytest.mark.thorough
def test_it_lets_go_of_a_cart_that_motion_capture_loses(tmp_path) -> None:
    lost = "{when: cart.position > 30 cm, on: drone, inject: mocap_dropout, object: cart, for: 1 s}"
    text = f"{TEXT}faults:\n  - {lost}\n"
    rehearsed = rehearse(compiled(with_library(tmp_path) / "push.yaml", text))
    assert not rehearsed.diagnostics
    told, _ = flown(text, tmp_path)
    [began], [ended] = times(told, "fault_injected"), times(told, "fault_ended")
    [failed] = [e for e in told if e.name == "behavior_failed"]
    assert "`cart` was last seen 0.2 s ago" in failed.fields["reason"]
    assert failed.time / NS < began + 0.25
    assert times(told, "object_lost", object="cart") == [pytest.approx(began + 0.5, abs=0.05)]
    assert times(told, "object_found", object="cart") == [pytest.approx(ended, abs=0.05)]
    assert not times(told, "collided")
    assert times(told, "landed")


@pytest.mark.thorough
def test_the_failsafe_lands_beside_what_the_vehicle_pushes(tmp_path) -> None:
    stuck = TEXT.replace("friction: 0.3 N", "friction: 3 N").replace(
        "vehicles:", "time_limit: 20 s\nvehicles:"
    )
    told, _ = flown(stuck, tmp_path)
    [began] = times(told, "behavior_started", behavior="auto_land")
    assert times(told, "contact_began")[-1] < began
    assert times(told, "contact_ended")[-1] < began + 2.0
    assert times(told, "landed")


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, 2])
def test_at_the_stop_it_no_longer_presses_and_lets_go(seed: int, tmp_path) -> None:
    text = TEXT.replace("to: 2 m", "to: 60 cm").replace("$goal - 1 cm", "59 cm")
    text = text.replace("next: [{when: cart.position > $goal, go: back}]\n        ", "")
    text = text.replace("  - finally cart.position < $goal + 5 cm\n", "")
    told, summary = flown(text, tmp_path, seed)
    assert summary["outcome"] == "succeeded"
    [ended] = times(told, "behavior_ended", behavior="push", how="done")
    assert times(told, "contact_ended")[-1] < ended + 1.0
