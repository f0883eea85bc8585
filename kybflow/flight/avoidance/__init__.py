"""Obstacle avoidance for behaviors and processors: obstacles and vehicles nearby (`surroundings`);
rules that change a velocity (`clearance`) or an acceleration (`barrier`) so that nothing is hit;
and setpoints that keep clear, also by a way around obstacles (`following`).
"""
