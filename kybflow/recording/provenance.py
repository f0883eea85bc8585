"""What a run was made of, and what was asked of it: the content of `provenance.json`."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from kybflow.dsl.plan import EstimatorPlan, Plan, SensorPlan

if TYPE_CHECKING:
    from datetime import datetime

FLOWN_FROM = "files"
"""Its key for the files that the mission names and that are in the run folder."""
_PACKAGES = ("kybflow", "mujoco", "numpy", "foxglove-sdk", "transitions", "PyYAML", "jsonschema")


def provenance(
    plan: Plan, request: Mapping[str, Any], started: datetime, files: Iterable[str]
) -> dict[str, Any]:
    """Sources with their SHA-256, the copied `files`, what was asked for as it is written on the
    command line, versions, machine."""
    return {
        "kybflow": 1,
        "mission": plan.mission,
        "target": plan.target,
        **request,
        "started": started.isoformat(timespec="seconds"),
        "sources": [{"path": source.path, "sha256": source.sha256} for source in plan.sources],
        FLOWN_FROM: [*files],
        "versions": {"python": platform.python_version(), **_versions(_packages(plan))},
        "machine": {
            "system": platform.platform(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
    }


def _packages(plan: Plan) -> Iterator[str]:
    """Those that every run uses, then those that its sensors and estimators need."""
    yield from _PACKAGES
    for vehicle in plan.vehicles:
        asked: list[SensorPlan | EstimatorPlan] = [*vehicle.sensors, *vehicle.estimators]
        for one in asked:
            yield from one.part.cls.packages


def _versions(packages: Iterable[str]) -> dict[str, str]:
    """Of those that are installed."""
    found = {}
    for package in dict.fromkeys(packages):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
