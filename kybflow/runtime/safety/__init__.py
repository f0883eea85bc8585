"""The safety functions of a vehicle: the failsafe, the hold of pause and brake, the vehicle's land
mode, the clamps of its setpoint, and the tolerance of its start position.
"""
