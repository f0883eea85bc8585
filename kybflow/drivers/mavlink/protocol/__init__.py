"""MAVLink as pure functions: frames and signatures, the conversion between messages and kybflow's
values, and between their frames of reference.

Only this package and the emulator use NED, FRD and scaled integers. It opens no socket and reads no
clock except the one that stamps signatures. The rest of the driver and the emulator call it.
"""
