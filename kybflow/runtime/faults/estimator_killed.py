"""An estimator of the vehicle fails, as if it had raised.

It is not used again for the rest of the run, also after the end of the fault, and the vehicle lands
on the next one.
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
