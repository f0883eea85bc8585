"""What keeps a vehicle safe: the failsafe, the hold of pause and brake, a vehicle's land mode,
and the tolerance of its start position.
"""
