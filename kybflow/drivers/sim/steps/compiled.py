"""The physics steps compiled by Numba, which `pip install '.[fast]'` installs.

Flights are identical to the bit with and without it. The kernel's machine code is cached on disk,
so that only the first flight after an installation waits for Numba.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import struct
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import mujoco
import numpy
from llvmlite import binding

from kybflow.core.files import write_whole
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

FAILURES = (ImportError, AttributeError, OSError, RuntimeError)
"""The exceptions raised if the kernel can't be compiled, cached or loaded, or MuJoCo's library is
missing."""
PLACES = (Path(__file__).parent / "__pycache__", Path("~/.cache/kybflow"))
"""Folders in which machine code is cached: in the package, or in the home folder if that is not
writable."""
_NAME, _DIGEST = "kybflow_steps", hashlib.sha256().digest_size


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
    """Makes the physics steps in compiled code. The constructor raises one of `FAILURES` if that is
    impossible."""

    def __init__(
        self, model: Any, data: Any, onboard: OnboardState, sources: Sequence[ImuSource]
    ) -> None:
        count = onboard.count
        self._onboard, self.errors = onboard, ImuErrors(sources, numpy.ascontiguousarray)
        self._samples, self._first, self._last = self.errors.block, 0, 0
        self._numbers = (
            data.qpos, data.qvel, data.qacc, data.qfrc_applied,
            numpy.array(shares(model.opt.timestep)), numpy.empty((count, 9)),
            numpy.empty((count, 6)), *(table.array for table in onboard.tables),
        )  # fmt: skip
        addresses = (array.ctypes.data for array in self._numbers)
        found = (self._samples.ctypes.data, model._address, data._address, *addresses)
        self._memory = (ctypes.c_void_p * len(found))(*found)
        self._address, self._owners = ctypes.addressof(self._memory), (model, data)
        self._unused = ctypes.c_void_p()
        self._nothing = ctypes.addressof(self._unused)
        self._engine = _loaded(_kept(_fingerprint((push, imu_sample, estimate, smooth, control))))
        # ctypes passes integers fastest as addresses
        kind = ctypes.PYFUNCTYPE(None, *[ctypes.c_void_p] * 6)
        self._kernel = kind(self._engine.get_function_address(_NAME))

    def advance(self, count: int) -> None:
        """Make `count` steps."""
        onboard, errors, nothing = self._onboard, self.errors, self._nothing
        self._first = first = errors.take(count)
        self._last = last = first + count
        if errors.block is not self._samples:
            self._samples = errors.block
            self._memory[0] = self._samples.ctypes.data
        self._kernel(nothing, nothing, first, last, onboard.count, self._address)
        onboard.steps += count

    def imu_samples(self) -> list[list[Numbers]]:
        """Return the IMU samples of all vehicles in each step of the last `advance`."""
        samples = self._samples[self._first : self._last].tolist()
        return [list(map(tuple, step)) for step in samples]  # compiled callers refuse lists


def _fingerprint(laws: Sequence[Any]) -> str:
    """Return a hash of the kernel's source, of the code and constants of the functions `laws`, and
    of the machine type."""
    kernel = Path(__file__).with_name("kernel.py").read_text()
    found = [kernel, repr((binding.llvm_version_info, binding.get_default_triple()))]
    for law in laws:
        code = law.__code__
        named = [repr(law.__globals__.get(name)) for name in code.co_names]
        found.append(repr((code.co_code, code.co_consts, named)))
    return hashlib.sha256("".join(found).encode()).hexdigest()


def _kept(fingerprint: str) -> bytes:
    """Return the kernel's machine code from the cache. If it is missing or damaged there, log that
    it is compiled, compile it and cache it."""
    files = [place.expanduser() / f"steps-{fingerprint[:32]}.o" for place in PLACES]
    for file in files:
        with suppress(OSError):
            kept = file.read_bytes()
            if kept[:_DIGEST] == _digest(kept[_DIGEST:]):
                return kept[_DIGEST:]
    logging.getLogger(__name__).info(
        "compiling the physics steps, once per installation: takes some seconds"
    )
    from kybflow.drivers.sim.steps.kernel import machine_code

    code = machine_code(_NAME)
    _keep(code, files)
    return code


def _keep(code: bytes, files: Sequence[Path]) -> None:
    """Write the code to the first of `files` that can be written. Raises OSError if none can."""
    for file in files:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, _digest(code) + code)
        except OSError as error:
            refused = error
        else:
            return
    raise refused


def _digest(code: bytes) -> bytes:
    return hashlib.sha256(code).digest()


def _loaded(code: bytes) -> Any:
    """Return an LLVM engine with the kernel loaded."""
    library = ctypes.CDLL(mujoco._functions.__file__)
    address = ctypes.cast(library.mj_step, ctypes.c_void_p).value
    binding.add_symbol("mj_step", address)
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine
