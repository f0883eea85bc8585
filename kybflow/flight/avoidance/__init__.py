"""Obstacle avoidance: obstacles and vehicles nearby (`obstacles`, `surroundings`); rules that bend
a velocity (`clearance`, `potential`) or an acceleration (`barrier`) so that nothing is hit; the way
around (`detour`); and setpoints that keep clear (`following`). Behaviors and processors call it.
"""
