"""A catalog with a driver that isn't a simulation, for tests of what is judged on hardware."""

from __future__ import annotations

from dataclasses import replace

from kybflow.drivers.sim import Sim
from kybflow.parts.catalog import Catalog, PartSpec, load_catalog


class HardwareCatalog(Catalog):
    """Everything installed, and under `name` a variant `driver` of the simulator's driver."""

    def __init__(self, driver: type[Sim], name: str = "bench") -> None:
        self._all, self._driver, self._name = load_catalog(), driver, name

    def names(self, kind: str) -> tuple[str, ...]:
        return (*self._all.names(kind), *([self._name] if kind == "drivers" else []))

    def get(self, kind: str, name: str) -> PartSpec:
        if (kind, name) == ("drivers", self._name):
            return replace(self._all.get(kind, "sim"), name=name, cls=self._driver)
        return self._all.get(kind, name)

    def always(self, kind: str) -> tuple[PartSpec, ...]:
        return self._all.always(kind)
