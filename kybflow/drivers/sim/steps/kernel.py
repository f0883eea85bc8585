"""The kernel: the physics steps of all vehicles as one function, which Numba compiles.

It calls the functions of `rotors`, `sensors` and `onboard`, and MuJoCo's `mj_step`, its only
external symbol. It uses neither Python nor Numba's runtime, so its machine code runs wherever it is
loaded. Its memory is given as plain addresses of numbers.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding
from numba import njit, types
from numba.core.errors import NumbaError
from numba.cpython.unsafe.tuple import tuple_setitem

from kybflow.drivers.sim.sensors import imu_sample
from kybflow.drivers.sim.steps.onboard import MAX_DEAD_TIME, control, estimate, smooth
from kybflow.drivers.sim.steps.rotors import push


def _row_of(numbers: Any, row: Any, like: Any) -> Any:
    for k in range(len(like)):
        like = tuple_setitem(like, k, numbers[row * len(like) + k])
    return like


def _put_in(numbers: Any, row: Any, values: Any) -> None:
    for k in range(len(values)):
        numbers[row * len(values) + k] = values[k]


_compiled = njit(error_model="numpy", _nrt=False)
_push, _imu_sample, _estimate, _smooth, _control = map(
    _compiled, (push, imu_sample, estimate, smooth, control)
)
_row, _put = map(_compiled, (_row_of, _put_in))
_NUMBERS = types.CPointer(types.float64)
_mj_step = types.ExternalFunction("mj_step", types.void(_NUMBERS, _NUMBERS))
_2, _3, _4, _5, _6, _7, _8, _9, _10, _14 = ((0.0,) * n for n in (2, 3, 4, 5, 6, 7, 8, 9, 10, 14))


def steps(first: Any, last: Any, count: Any, memory: Any) -> None:
    """Make the steps from `first` up to `last` (exclusive) for `count` vehicles, and replace the
    IMUs' errors by their samples. memory: addresses, in the order of `CompiledStepper`."""
    errors, model, data = memory[0], memory[1], memory[2]
    positions, velocities, accelerations, forces = memory[3], memory[4], memory[5], memory[6]
    shares, rotations, before = memory[7], memory[8], memory[9]
    setpoints, filters, loops, gains = memory[10], memory[11], memory[12], memory[13]
    gyros, delays, controls, rotors = memory[14], memory[15], memory[16], memory[17]
    thrusts, winds, pushes, constants = memory[18], memory[19], memory[20], memory[21]
    asked, part = memory[22], _row(shares, 0, _3)
    for step in range(first, last):
        for i in range(count):
            velocity = _row(velocities, i, _6)
            force, rotation, after = _push(
                _row(positions, i, _7), velocity, _row(rotors, i, _4), _row(controls, i, _4),
                _row(thrusts, i, _4), _row(winds, i, _3), _row(pushes, i, _6),
                _row(constants, i, _5),
            )  # fmt: skip
            _put(before, i, velocity)
            _put(forces, i, force)
            _put(rotations, i, rotation)
            _put(rotors, i, after)
        _mj_step(model, data)
        for i in range(count):
            here = step * count + i
            sample = _imu_sample(
                _row(rotations, i, _9), _row(before, i, _6),
                _row(accelerations, 2 * i, _3), _row(errors, here, _6),
            )  # fmt: skip
            setpoint = _row(setpoints, i, _10)
            filtered, rates = _estimate(_row(filters, i, _8), setpoint, sample, part)
            gyro, rates = _smooth(_row(gyros, i, _7), rates)
            loop, wanted = _control(
                _row(loops, i, _7), filtered, rates, setpoint, _row(gains, i, _14)
            )
            _put(errors, here, sample)
            _put(filters, i, filtered)
            _put(gyros, i, gyro)
            _put(loops, i, loop)
            place, late = _row(delays, i, _2)
            if late > 0.0:
                here = i * MAX_DEAD_TIME + int(place)
                arrived = _row(asked, here, _4)
                _put(asked, here, wanted)
                _put(delays, i, ((place + 1.0) % late, late))
                wanted = arrived
            _put(controls, i, wanted)


def machine_code(name: str) -> bytes:
    """Return the kernel as an object file for this machine type, with a function called `name`. By
    Numba's convention, two addresses for its result and its exception, both unused, precede its
    arguments. Raises RuntimeError if the kernel can't be compiled."""
    whole = types.intp
    signature = types.void(whole, whole, whole, types.CPointer(_NUMBERS))
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    try:
        made = njit(signature, error_model="numpy", _nrt=False, **options)(steps)
    except NumbaError as error:
        raise RuntimeError(str(error)) from error
    module = binding.parse_assembly(made.inspect_llvm(made.signatures[0]))
    for function in module.functions:
        if function.linkage == binding.Linkage.external and not function.is_declaration:
            function.name = name
    machine = binding.Target.from_default_triple().create_target_machine(opt=3, jit=True)
    code: bytes = machine.emit_object(module)
    return code
