"""Obstacle avoidance for behaviors and processors: obstacles and vehicles nearby (`obstacles`,
`surroundings`); rules that change a velocity (`clearance`, `potential`) or an acceleration
(`barrier`) so that nothing is hit; the way around obstacles (`detour`); and setpoints that keep
clear (`following`)."""
