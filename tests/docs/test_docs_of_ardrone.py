"""What docs/ardrone.md writes is valid, and it names every act of a drone."""

from __future__ import annotations

from pathlib import Path

import pytest
from pages import blocks, page
from toolchain import compiled

from kybflow.drivers.ardrone.acts import ACTS

PAGE = page("docs/ardrone.md")
MINE, TARGETS, BY_HAND, RADIO, ON = blocks(PAGE)
HEAD = """kybflow: 1
mission: by_hand
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
"""
PAD = BY_HAND.partition("\n\n")[0]


@pytest.mark.parametrize("target", ["lab", "emulated_ardrone"])
@pytest.mark.parametrize("stick", [PAD, RADIO.replace("give: button1", "give: button1, land: x")])
def test_what_is_written_is_valid(target: str, stick: str, tmp_path: Path) -> None:
    vehicles = BY_HAND.partition("\n\n")[2].replace(
        "like: std.ardrone\n", "like: std.ardrone\n    start: {at: [0, 0, 0]}\n"
    )
    compiled(tmp_path / "mine.yaml", "\n".join((HEAD, stick, vehicles, TARGETS, ON)), target=target)


def test_the_mission_to_begin_with_is_valid(tmp_path: Path) -> None:
    compiled(tmp_path / "mine.yaml", MINE, target="lab")


def test_every_act_is_named() -> None:
    assert [act for act in ACTS if f"`{act}`" not in PAGE] == []
