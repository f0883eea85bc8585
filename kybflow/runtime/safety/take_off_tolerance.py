"""How far a vehicle that stands may be from where it should, as its estimate has it.

    allowed = max(25 cm, min(3 spread, 2 m))

with the estimate's own spread: one that knows itself to be vague, as on positions alone, can't be
held to what motion capture tells.
"""

from __future__ import annotations

from kybflow.core.signals import Estimate

LEAST = 0.25
WIDEST = 2.0
SPREADS = 3.0


def allowed(estimate: Estimate) -> float:
    """Metres."""
    return max(LEAST, min(SPREADS * estimate.spread, WIDEST))


def said(estimate: Estimate) -> str:
    """The same in words."""
    metres = allowed(estimate)
    if metres <= LEAST:
        return f"{metres:.2f} m allowed"
    why = "the most" if metres >= WIDEST else f"{SPREADS:g} times its spread"
    return f"{metres:.2f} m allowed, {why}"
