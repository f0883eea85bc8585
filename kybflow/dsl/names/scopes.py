"""Scopes: the names that each expression of a mission may use."""

from __future__ import annotations

from kybflow.dsl.expressions import Scope
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import Plan
from kybflow.parts.observables import chains_of


class Scopes:
    """The scope of every expression of a plan. Each scope is created once, because it caches what
    was parsed in it."""

    def __init__(self, plan: Plan) -> None:
        vehicles, fleet = plan.vehicles, plan.fleet
        self._states = {
            v.name: (
                *v.states,
                *dict.fromkeys(c for s in v.states for c in chains_of(s)),
                *BUILT_IN,
            )
            for v in vehicles
        }
        estimators = {v.name: tuple(use.part.alias for use in v.estimators) for v in vehicles}
        groups = {
            name: tuple(member for member in members if member in fleet)
            for name, members in plan.groups.items()
        }
        carriers = frozenset(v.name for v in vehicles if v.payload is not None)
        self._known = (estimators, plan.points, groups, carriers)
        self._inputs = {use.name: use.axes for use in plan.inputs}
        self._conditions: dict[str | None, Scope] = {}
        self._health = {own: Scope("health", {}, own) for own in fleet}
        self._expectation = Scope("expectation", self._states, None, *self._known)

    def condition(self, vehicle: str | None) -> Scope:
        """Return the scope of a `when` of `vehicle`; None for a flow or callback. The name of a
        chain counts as a state, which is active in all states of the chain."""
        if vehicle not in self._conditions:
            scope = Scope("condition", self._states, vehicle, *self._known, self._inputs)
            self._conditions[vehicle] = scope
        return self._conditions[vehicle]

    def flow(self) -> Scope:
        """Return the scope of a `when` in a phase or callback, in which every vehicle is named."""
        return self.condition(None)

    def health(self, vehicle: str) -> Scope:
        """Return the scope of `healthy` of an estimator: its own age and spread."""
        return self._health[vehicle]

    def expectation(self) -> Scope:
        return self._expectation
