"""A lab's own parts may be without what ours have, and may raise: the checks go on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from short_flights import NoParams
from toolchain import result_of

from kybflow.parts import Fault, Supervisor
from kybflow.parts.catalog import Catalog, PartSpec, load_catalog

MISSION = """\
kybflow: 1
mission: labs
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    supervisors: [lonely, {use: battery, reaction: warn}]
    behaviors:
      up:   {do: take_off, height: 1 m, then: hold, within: 15 s}
      hold: {do: hover, for_time: 3 s, next: [{when: battery.remaining < 50 %, go: down}], then: down}
      down: {do: land}
faults:
  - {at: 6 s, on: a, inject: unmade}
"""  # noqa: E501


class Lonely(Supervisor[NoParams]):
    """Has no reaction that a mission could choose."""

    events = ("lonely",)

    def check(self, tick, off_ground):
        return None


class Unmade(Fault[NoParams]):
    """Can't be made."""

    def __init__(self, params, generator):
        raise RuntimeError("no such device")

    def effects(self, vehicle):
        return {}


class Lab(Catalog):
    OWN = {("supervisors", "lonely"): Lonely, ("faults", "unmade"): Unmade}  # noqa: RUF012

    def __init__(self) -> None:
        self._all = load_catalog()

    def names(self, kind: str) -> tuple[str, ...]:
        return (*self._all.names(kind), *(name for own, name in self.OWN if own == kind))

    def get(self, kind: str, name: str) -> PartSpec:
        cls = self.OWN.get((kind, name))
        if cls is None:
            return self._all.get(kind, name)
        spec = self._all.get(kind, self._all.names(kind)[0])
        return replace(spec, name=name, cls=cls, params=NoParams, fields=())

    def always(self, kind: str) -> tuple[PartSpec, ...]:
        return self._all.always(kind)


def test_nothing_is_said_of_them(tmp_path: Path) -> None:
    assert result_of(tmp_path / "labs.yaml", MISSION, catalog=Lab()).diagnostics == ()
