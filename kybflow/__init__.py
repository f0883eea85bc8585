"""kybflow: experiments with quadrotors, written in YAML, proven before take-off, flown.

    run = kybflow.run("missions/figure_eight.yaml", seed=1)
    nano = run.vehicle("nano")
    print(run.outcome, numpy.nanmax(nano.error), nano.position.shape)

Everything is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kybflow.api.experiment import connect as connect
    from kybflow.api.experiment import rehearse as rehearse
    from kybflow.api.experiment import run as run
    from kybflow.api.missions import Findings as Findings
    from kybflow.api.missions import MissionInvalid as MissionInvalid
    from kybflow.api.missions import validate as validate
    from kybflow.api.replay.replay import replay as replay
    from kybflow.api.runs import RecordedVehicle as RecordedVehicle
    from kybflow.api.runs import Run as Run
    from kybflow.command_server.client import CommandRefused as CommandRefused
    from kybflow.command_server.client import RunClient as RunClient
    from kybflow.core.errors import KybflowError as KybflowError
    from kybflow.core.signals import Event as Event
    from kybflow.dsl.diagnostics import Diagnostic as Diagnostic

__version__ = "0.1.0"

_HOMES = {
    "api.experiment": ("connect", "rehearse", "run"),
    "api.missions": ("Findings", "MissionInvalid", "validate"),
    "api.replay.replay": ("replay",),
    "api.runs": ("RecordedVehicle", "Run"),
    "command_server.client": ("CommandRefused", "RunClient"),
    "core.errors": ("KybflowError",),
    "core.signals": ("Event",),
    "dsl.diagnostics": ("Diagnostic",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*_HOME, "__version__"]
