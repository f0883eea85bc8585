"""The allowed distance of a vehicle's estimate from its declared start before take-off:

    allowed = max(25 cm, min(3 spread, 2 m))

It grows with the spread of the estimate, because GPS alone is less accurate than motion capture.
"""

from __future__ import annotations

from kybflow.core.signals import Estimate

LEAST = 0.25
WIDEST = 2.0
SPREADS = 3.0


def allowed(estimate: Estimate) -> float:
    """Return the largest allowed distance in metres."""
    return max(LEAST, min(SPREADS * estimate.spread, WIDEST))


def said(estimate: Estimate) -> str:
    """Return a description of the allowed distance, for a message."""
    metres = allowed(estimate)
    if metres <= LEAST:
        return f"{metres:.2f} m allowed"
    why = "the most" if metres >= WIDEST else f"{SPREADS:g} times its spread"
    return f"{metres:.2f} m allowed, {why}"
