"""The maths of flight that the runtime and the drivers share: motion profiles, trajectories,
steering, mass estimation, tracking of poses and coming down blind. Pure: no part, no event, no
driver.
"""
