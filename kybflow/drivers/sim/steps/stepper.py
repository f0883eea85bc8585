"""The physics steps of all vehicles: rotors, MuJoCo, IMUs, on-board control."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy

from kybflow.core.errors import described
from kybflow.drivers.sim.sensors import ImuErrors, ImuSource, imu_sample
from kybflow.drivers.sim.steps.onboard import (
    Numbers,
    OnboardState,
    control,
    estimate,
    shares,
    smooth,
)
from kybflow.drivers.sim.steps.rotors import push

_PACK, _SIZE = struct.Struct("6d").pack_into, 6 * 8


class Stepper:
    """Makes the physics steps in Python. sources: the IMU errors of each vehicle."""

    def __init__(
        self, model: Any, data: Any, onboard: OnboardState, sources: Sequence[ImuSource]
    ) -> None:
        self._model, self._data, self._onboard = model, data, onboard
        self.errors = ImuErrors(sources, numpy.ndarray.tolist)
        self._samples: list[list[Numbers]] = []
        count = onboard.count
        self._positions = data.qpos[: 7 * count].reshape(count, 7)
        self._velocities = data.qvel[: 6 * count].reshape(count, 6)
        self._accelerations = data.qacc[: 6 * count].reshape(count, 6)[:, :3]
        self._forces = data.qfrc_applied
        self._shares = shares(model.opt.timestep)

    def imu_samples(self) -> list[list[Numbers]]:
        """Return the IMU samples of all vehicles in each step of the last `advance`."""
        return self._samples

    def advance(self, count: int) -> None:
        """Make `count` steps."""
        on, model, data, part = self._onboard, self._model, self._data, self._shares
        rotors, controls, filters, loops = on.rotors, on.controls, on.filters, on.loops
        setpoints, gains, gyros, self._samples = on.setpoints, on.gains, on.gyros, []
        first, is_slow = self.errors.take(count), on.is_slow
        for errors in self.errors.block[first : first + count]:
            rotations, velocities = [], self._velocities.tolist()
            for i, position in enumerate(self._positions.tolist()):
                force, rotation, rotors[i] = push(
                    position, velocities[i], rotors[i], controls[i],
                    on.thrusts[i], on.winds[i], on.pushes[i], on.constants[i],
                )  # fmt: skip
                _PACK(self._forces, _SIZE * i, *force)
                rotations.append(rotation)
            mujoco.mj_step(model, data)
            samples = list(
                map(imu_sample, rotations, velocities, self._accelerations.tolist(), errors)
            )
            for i, sample in enumerate(samples):
                filters[i], rates = estimate(filters[i], setpoints[i], sample, part)
                if is_slow:
                    gyros[i], rates = smooth(gyros[i], rates)
                loops[i], wanted = control(loops[i], filters[i], rates, setpoints[i], gains[i])
                controls[i] = on.delayed(i, wanted) if is_slow else wanted
            self._samples.append(samples)
        on.steps += count


def rows() -> Callable[[int, int], Any]:
    """Return a function that makes rows of zeros, given their count and width. The rows have the
    type that suits the fastest available stepper; every stepper accepts either type."""
    if _is_fast():
        from kybflow.drivers.sim.steps.compiled import ArrayRows

        return ArrayRows
    return lambda count, width: [(0.0,) * width] * count


def stepper(model: Any, data: Any, onboard: OnboardState, sources: Sequence[ImuSource]) -> Any:
    """Return the fastest available stepper, which is the compiled one if Numba is installed. Warns
    if it can't be compiled; flights are then identical, but slower."""
    if not _is_fast():
        return Stepper(model, data, onboard, sources)
    from kybflow.drivers.sim.steps.compiled import FAILURES, CompiledStepper

    try:
        return CompiledStepper(model, data, onboard, sources)
    except FAILURES as error:
        reason = described(error)
        warnings.warn(
            f"Numba can't compile the physics steps: {reason}; Python computes them", stacklevel=2
        )
        return Stepper(model, data, onboard, sources)


def _is_fast() -> bool:
    """Return whether Numba is installed, without importing it."""
    return find_spec("numba") is not None
