"""Keeping away from what stands or flies in the way: what is near (`surroundings`); the rules that
bend a velocity (`clearance`, `potential`) or an acceleration (`barrier`) so that nothing is hit;
the way round (`detour`); and setpoints that keep off (`following`). Behaviors and processors call
it.
"""
