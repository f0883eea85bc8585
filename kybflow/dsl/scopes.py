"""What the expressions of a mission may name."""

from __future__ import annotations

from kybflow.dsl.built_in import BUILT_IN
from kybflow.dsl.document import Document
from kybflow.dsl.expressions import Scope


class Scopes:
    """The scope of every expression of a document."""

    def __init__(self, document: Document) -> None:
        vehicles = document.vehicles.items()
        self._states = {name: (*v.states, *BUILT_IN) for name, v in vehicles}
        self._estimators = {
            name: tuple(use.part.label for use in v.estimators) for name, v in vehicles
        }

    def condition(self, vehicle: str) -> Scope:
        """What a `when` of `vehicle` may name."""
        return Scope("condition", self._states, vehicle, self._estimators)

    def health(self, vehicle: str) -> Scope:
        """What an estimator's health may name: its own age and spread."""
        return Scope("health", {}, vehicle)

    def expectation(self) -> Scope:
        return Scope("expectation", self._states, None, self._estimators)
