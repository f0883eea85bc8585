"""Reactions to what supervisors report: the failsafe, the hold of pause and brake, a vehicle's own
land mode, how far a vehicle may stand from its start.
"""
