"""What `kybflow` uses of `forcedimension_core.dhd` 1.0, without the maker's SDK or a device.

A call gives a negative number where it fails; the axes are the device's own.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from types import ModuleType


class FakeForceDimension(ModuleType):
    """Stands for the module `forcedimension_core`, and its module `dhd`."""

    def __init__(self) -> None:
        super().__init__("forcedimension_core")
        self.dhd = self
        self.position = self.velocity = self.force = (0.0, 0.0, 0.0)
        self.mask = 0
        self.is_there, self.is_open, self.forces, self.fails = True, False, False, False

    def open(self) -> int:
        self.is_open = self.is_there
        return 0 if self.is_there else -1

    def close(self, ID: int = -1) -> int:  # noqa: N803
        self.is_open = False
        return 0

    def enableForce(self, enable: bool, ID: int = -1) -> int:  # noqa: N803
        self.forces = enable
        return 0

    def getPosition(self, out: MutableSequence[float], ID: int = -1) -> int:  # noqa: N803
        out[:] = self.position
        return -1 if self.fails else 0

    def getLinearVelocity(self, out: MutableSequence[float], ID: int = -1) -> int:  # noqa: N803
        out[:] = self.velocity
        return 0

    def getButtonMask(self, ID: int = -1) -> int:  # noqa: N803
        return self.mask

    def setForce(self, f: Sequence[float], ID: int = -1) -> int:  # noqa: N803
        self.force = tuple(f)
        return 0
