"""What `kybflow preflight --by-hand` tells the person who moves the vehicle."""

from __future__ import annotations

from math import degrees

from kybflow.core.geometry import norm
from kybflow.flight.hand_check.motions import HandMotion, HandStep
from kybflow.flight.hand_check.verdict import named_way

_ASKED = {
    HandStep.REST: "Let {name} stand on the floor, level, and don't touch it.",
    HandStep.LIFT: "Lift {name} straight up by about 30 cm, within a second or two; hold it still.",
    HandStep.ALONG_X: "Carry it by about 30 cm along +x of the mission's world; hold it still.",
    HandStep.ALONG_Y: "Carry it by about 30 cm along +y, to the left of +x; hold it still.",
    HandStep.DIP: "Dip its nose by about 30 degrees; hold it still.",
}


def asked(step: HandStep, name: str) -> str:
    """Return the prompt of a step."""
    return _ASKED[step].format(name=name)


def shown(motion: HandMotion | None) -> str:
    """Return what a step has shown; None after the rest."""
    if motion is None:
        return "  it rests"
    if motion.step is HandStep.DIP:
        turn = motion.seen_turn if motion.felt_turn is None else motion.felt_turn
        return f"  seen: {degrees(norm(turn)):.0f} deg"
    return f"  seen: {named_way(motion.seen)}"
