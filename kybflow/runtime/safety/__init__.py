"""What keeps a vehicle safe: the failsafe, the hold of pause and brake, a vehicle's land mode, the
clamps of its setpoint, and the tolerance of its start position.
"""
