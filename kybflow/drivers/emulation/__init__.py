"""What emulated vehicles of any kind need, so that a driver flies a simulated vehicle that has a
mind of its own.

Here are the simulated body with the sensors and the battery that the emulated computer reads, its
attitude and position estimation, its position controller, failures that are caused on purpose, and
a fleet of such vehicles in one world, in lockstep with the engine's clock or served in real time.
What the vehicle says and obeys, its protocol and its modes, belongs to the emulator that uses this
folder, such as `emulated_autopilot`. Nothing here imports one, nor a driver for real vehicles.
"""
