"""Who may ask a vehicle to enter which state: flows in their phases, and callbacks."""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.dsl.plan import Plan, Switch

Asked = Mapping[str, tuple[str, ...]]
"""The states that are asked for, by who asks."""


def asked(plan: Plan, vehicle: str) -> Asked:
    """Who asks `vehicle` for what, each state once."""
    found: dict[str, dict[str, None]] = {}
    for flow in plan.flows:
        for phase in flow.phases.values():
            if vehicle in phase.run:
                found.setdefault(f"flow {flow.name}", {})[phase.run[vehicle]] = None
    for callback in plan.callbacks:
        for action in callback.actions:
            if isinstance(action, Switch) and action.vehicle == vehicle:
                found.setdefault(f"on {callback.event}", {})[action.state] = None
    return {name: tuple(states) for name, states in found.items()}
