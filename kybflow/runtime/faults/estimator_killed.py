"""An estimator of the vehicle fails, as if it had raised an exception.

The estimator is not used again for the rest of the run, even after the fault ends. The vehicle
lands with the next estimator.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.parts import Effect, Fault, param, params


@params
class EstimatorKilledParams:
    estimator: str = param(
        "Name of the estimator in the mission.", names="estimator", read_only=True
    )


class EstimatorKilled(Fault[EstimatorKilledParams]):
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(estimator=self.params.estimator)}
