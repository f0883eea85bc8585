"""The physics steps compiled by Numba, which `pip install '.[fast]'` brings.

One kernel makes all steps of all vehicles. It calls the functions of `rotors`, `sensors` and
`onboard`, which stand there once, and MuJoCo's `mj_step` by its address. A flight is the same to
the bit as without. What is compiled stays on disk: only the first flight after an install waits.
"""

from __future__ import annotations

import ctypes
import hashlib
import struct
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy
from llvmlite import binding
from numba import njit, types
from numba.core.errors import NumbaError
from numba.np.unsafe.ndarray import to_fixed_tuple

from kybflow.drivers.sim.aboard import Aboard, Numbers
from kybflow.drivers.sim.onboard import control, estimate, shares
from kybflow.drivers.sim.rotors import push
from kybflow.drivers.sim.sensors import ImuErrors, feel

FAILURES = (NumbaError, AttributeError, OSError, RuntimeError)
"""What may go wrong when the kernel is compiled or MuJoCo's library isn't found."""


def _put_in(row: Any, numbers: Any) -> None:
    for k in range(len(numbers)):
        row[k] = numbers[k]


_mj_step = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))
_push, _feel, _estimate, _control, _put = map(njit, (push, feel, estimate, control, _put_in))


class ArrayRows:
    """Rows of numbers in an array."""

    def __init__(self, count: int, width: int) -> None:
        self.array = numpy.zeros((count, width))
        self._bytes = self.array.data
        numbers = struct.Struct(f"{width}d")
        self._size, self._pack, self._unpack = numbers.size, numbers.pack_into, numbers.unpack_from

    def __getitem__(self, vehicle: int) -> Numbers:
        return self._unpack(self._bytes, self._size * vehicle)

    def __setitem__(self, vehicle: int, numbers: Numbers) -> None:
        self._pack(self._bytes, self._size * vehicle, *numbers)


class CompiledStepper:
    """Makes the physics steps, compiled. Raises one of `FAILURES` where that can't be done."""

    def __init__(self, model: Any, data: Any, aboard: Aboard, sources: Sequence[Any]) -> None:
        library = ctypes.CDLL(mujoco._functions.__file__)
        address = ctypes.cast(library.mj_step, ctypes.c_void_p).value
        binding.add_symbol("mj_step", address)
        count = aboard.count
        self._aboard, self.errors = aboard, ImuErrors(sources, numpy.ascontiguousarray)
        self._felt = numpy.empty((0, count, 6))
        self._arguments = (
            model._address, data._address,
            data.qpos[: 7 * count].reshape(count, 7), data.qvel[: 6 * count].reshape(count, 6),
            data.qacc[: 6 * count].reshape(count, 6),
            data.qfrc_applied[: 6 * count].reshape(count, 6), shares(model.opt.timestep),
            *(table.array for table in aboard.tables),
        )  # fmt: skip
        self._owners = model, data
        self._kernel = _kernel(_fingerprint((push, feel, estimate, control)))
        self.advance(0)

    def advance(self, count: int) -> None:
        """Make `count` steps."""
        self._felt = numpy.empty((count, self._aboard.count, 6))
        self._kernel(self.errors.take(count), self._felt, *self._arguments)
        self._aboard.steps += count

    def felt(self, vehicle: int) -> list[Numbers]:
        """What a vehicle's IMU measured in each step of the last `advance`."""
        samples: list[Numbers] = self._felt[:, vehicle].tolist()
        return samples


def _fingerprint(functions: Sequence[Any]) -> str:
    """Tells one version of the laws from another: their code and the constants that it names."""
    found = []
    for function in functions:
        code = function.__code__
        named = [repr(function.__globals__.get(name)) for name in code.co_names]
        found.append(repr((code.co_code, code.co_consts, named)))
    return hashlib.sha256("".join(found).encode()).hexdigest()


def _kernel(fingerprint: str) -> Any:
    """The kernel. Numba finds it on disk by this file and by what the function below encloses, and
    would not notice that a law has changed in another file."""

    def steps(
        errors: Any, felt: Any, model: Any, data: Any, positions: Any, velocities: Any,
        accelerations: Any, forces: Any, part: Any, setpoints: Any, filters: Any, loops: Any,
        gains: Any, controls: Any, rotors: Any, thrusts: Any, winds: Any, constants: Any,
    ) -> None:  # fmt: skip
        fingerprint  # noqa: B018 - enclosed, so that another law is another kernel
        count = len(positions)
        rotations = numpy.empty((count, 9))
        for step in range(len(errors)):
            before = velocities.copy()
            for i in range(count):
                force, rotation, after = _push(
                    to_fixed_tuple(positions[i], 7), to_fixed_tuple(velocities[i], 6),
                    to_fixed_tuple(rotors[i], 4), to_fixed_tuple(controls[i], 4),
                    to_fixed_tuple(thrusts[i], 4), to_fixed_tuple(winds[i], 2),
                    to_fixed_tuple(constants[i], 4),
                )  # fmt: skip
                _put(forces[i], force)
                _put(rotations[i], rotation)
                _put(rotors[i], after)
            _mj_step(model, data)
            for i in range(count):
                sample = _feel(
                    to_fixed_tuple(rotations[i], 9), to_fixed_tuple(before[i], 6),
                    to_fixed_tuple(accelerations[i, :3], 3), to_fixed_tuple(errors[step, i], 6),
                )  # fmt: skip
                setpoint = to_fixed_tuple(setpoints[i], 10)
                filtered, rates = _estimate(to_fixed_tuple(filters[i], 8), setpoint, sample, part)
                loop, wanted = _control(
                    to_fixed_tuple(loops[i], 7), filtered, rates, setpoint,
                    to_fixed_tuple(gains[i], 11),
                )  # fmt: skip
                _put(felt[step, i], sample)
                _put(filters[i], filtered)
                _put(loops[i], loop)
                _put(controls[i], wanted)

    return njit(cache=True)(steps)
