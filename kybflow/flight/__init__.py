"""The maths of flight that the runtime and the drivers share: motion profiles, trajectories,
steering, mass estimation, tracking of poses and blind descent. It contains no part, event or
driver."""
