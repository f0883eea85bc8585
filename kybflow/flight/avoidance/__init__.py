"""Keeping away from what stands or flies in the way: what is near (`surroundings`), and the rules
that bend a velocity (`clearance`) or an acceleration (`barrier`) so that nothing is hit. Behaviors
and processors call it.
"""
