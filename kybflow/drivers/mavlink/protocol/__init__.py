"""MAVLink as pure functions: frames and signatures, messages to and from kybflow's values, and the
frames of reference between them.

NED, FRD and scaled integers exist here and in the emulator only. No socket, no clock but the one
that stamps signatures; the rest of the driver and the emulator call it.
"""
