"""Drivers, which open and command vehicles, simulated or real. Each module or folder is one driver.

A driver implements `kybflow.parts.Driver`. The API and the command line open drivers through the
catalog of parts; no layer below this package imports it.
"""

from __future__ import annotations

from pkgutil import iter_modules


def firmware_names(driver: str) -> tuple[str, ...]:
    """Return the firmwares that a driver supports, in reverse alphabetical order, as the command
    line lists them. They are the modules of the driver's folder `firmware`; none is imported."""
    found = iter_modules([f"{home}/{driver}/firmware" for home in __path__])
    return tuple(sorted((module.name for module in found), reverse=True))
