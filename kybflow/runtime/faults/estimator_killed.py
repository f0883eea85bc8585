"""An estimator of the vehicle fails, as one does that raises.

It is not asked again, and the vehicle lands on the next one. That is so for the rest of the run,
also where the fault ends.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.parts import Effect, Fault, param, params


@params
class EstimatorKilledParams:
    estimator: str = param("Its name, as the mission calls it.", names="estimator", read_only=True)


class EstimatorKilled(Fault[EstimatorKilledParams]):
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(estimator=self.params.estimator)}
