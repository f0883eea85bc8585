"""Shared parts of emulated vehicles: simulated vehicles with an emulated computer on each.

Here are the simulated body with the sensors and the battery that the emulated computer reads, its
attitude and position estimation, its position controller, injected failures, and a fleet of such
vehicles in one world, in lockstep with the engine's clock or served in real time. Protocols and
modes belong to the emulators that use this folder, such as `emulated_autopilot`. Nothing here
imports one, nor a driver for real vehicles.
"""
