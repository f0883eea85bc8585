"""A VRPN server made of the C++ library in the wheel `motioncapture`; run as a program of its own,
because a wrong call would end the whole process.

    python cpp_vrpn_server.py PORT NAME...

Each tracker NAME has two sensors; the pose of sensor s of tracker i at its k-th report is
(i, s, k / 1000) with the attitude x y z w = (0, 0, 0.6, 0.8).
"""

import ctypes
import sys
import time
from ctypes import byref, c_char_p, c_double, c_int, c_long, c_uint, c_void_p

import motioncapture

lib = ctypes.CDLL(motioncapture.__file__)
CREATE = lib._Z29vrpn_create_server_connectionPKcS0_S0_
MAKE = lib._ZN19vrpn_Tracker_ServerC1EPKcP15vrpn_Connectioni
REPORT = lib._ZN19vrpn_Tracker_Server11report_poseEi7timevalPKdS2_j
TRACKER_LOOP = lib._ZN19vrpn_Tracker_Server8mainloopEv
CONNECTION_LOOP = lib._ZN18vrpn_Connection_IP8mainloopEPK7timeval
LOW_LATENCY = 4
SIZE = 1 << 16


class Timeval(ctypes.Structure):
    _fields_ = (("seconds", c_long), ("microseconds", c_long))


CREATE.restype, CREATE.argtypes = c_void_p, (c_char_p, c_char_p, c_char_p)
MAKE.restype, MAKE.argtypes = None, (c_void_p, c_char_p, c_void_p, c_int)
REPORT.restype = c_int
REPORT.argtypes = (c_void_p, c_int, Timeval, c_void_p, c_void_p, c_uint)
TRACKER_LOOP.restype, TRACKER_LOOP.argtypes = None, (c_void_p,)
CONNECTION_LOOP.restype, CONNECTION_LOOP.argtypes = c_int, (c_void_p, c_void_p)


def tracker(name: str, connection: int) -> tuple[int, object]:
    """A tracker's address and the memory that it lives in."""
    memory = ctypes.create_string_buffer(SIZE + 64)
    address = (ctypes.addressof(memory) + 63) & ~63
    MAKE(address, name.encode(), connection, 2)
    return address, memory


def main() -> None:
    connection = CREATE(f"127.0.0.1:{sys.argv[1]}".encode(), None, None)
    trackers = [tracker(name, connection) for name in sys.argv[2:]]
    attitude = (c_double * 4)(0.0, 0.0, 0.6, 0.8)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    count = 0
    while True:
        count += 1
        for i, (address, _) in enumerate(trackers):
            for sensor in range(2):
                ns = time.time_ns()
                stamp = Timeval(ns // 10**9, ns % 10**9 // 1000)
                position = (c_double * 3)(i, sensor, count / 1000)
                REPORT(address, sensor, stamp, byref(position), byref(attitude), LOW_LATENCY)
            TRACKER_LOOP(address)
        CONNECTION_LOOP(connection, None)
        time.sleep(0.005)


main()
