"""Drivers: what opens and commands vehicles, simulated or real; each module or folder is one.

A driver implements `kybflow.parts.Driver`. The API and the command line open drivers through the
catalog of parts; nothing below this package imports it.
"""

from __future__ import annotations

from pkgutil import iter_modules


def firmware_names(driver: str) -> tuple[str, ...]:
    """The firmwares that a driver knows: the modules of its folder `firmware`, in the order of the
    command line's choices, last letter first. Imports none of them."""
    found = iter_modules([f"{home}/{driver}/firmware" for home in __path__])
    return tuple(sorted((module.name for module in found), reverse=True))
