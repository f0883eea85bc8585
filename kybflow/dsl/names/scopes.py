"""Scopes: what each expression of a mission may name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from kybflow.dsl.expressions import Scope
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts.observables import chains_of


class Scopes:
    """The scope of every expression of a plan."""

    def __init__(self, plan: Plan) -> None:
        vehicles = plan.vehicles
        self._states = {v.name: (*v.states, *_chains(v), *BUILT_IN) for v in vehicles}
        self._estimators = {v.name: tuple(e.part.alias for e in v.estimators) for v in vehicles}
        self._points = plan.points
        self._carriers = frozenset(v.name for v in vehicles if v.payload is not None)
        self._scopes: dict[tuple[str, str | None], Scope] = {}
        self._groups = {
            name: tuple(member for member in members if member in plan.fleet)
            for name, members in plan.groups.items()
        }
        self._inputs = {use.name: use.axes for use in plan.inputs}

    def condition(self, vehicle: str) -> Scope:
        """The scope of a `when` of `vehicle`."""
        return self._scope("condition", vehicle)

    def flow(self) -> Scope:
        """The scope of a phase's `when`: every vehicle, and no vehicle of its own."""
        return self._scope("condition", None)

    def health(self, vehicle: str) -> Scope:
        """The scope of an estimator's `healthy`: its own age and spread."""
        return self._made("health", vehicle, lambda: Scope("health", {}, vehicle))

    def expectation(self) -> Scope:
        return self._scope("expectation", None)

    def _scope(self, kind: Literal["condition", "expectation"], own: str | None) -> Scope:
        whole = (
            self._states, own, self._estimators, self._points, self._groups, self._carriers,
            {} if kind == "expectation" else self._inputs,
        )  # fmt: skip
        return self._made(kind, own, lambda: Scope(kind, *whole))

    def _made(self, kind: str, own: str | None, make: Callable[[], Scope]) -> Scope:
        """The scope, made once: it remembers what was parsed in it."""
        if (kind, own) not in self._scopes:
            self._scopes[kind, own] = make()
        return self._scopes[kind, own]


def _chains(vehicle: VehiclePlan) -> list[str]:
    """The chains of a vehicle: it is in one while it is in a state inside."""
    return list(dict.fromkeys(chain for state in vehicle.states for chain in chains_of(state)))
