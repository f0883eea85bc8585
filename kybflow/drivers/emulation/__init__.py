"""Shared parts of emulated vehicles: simulated vehicles with an emulated onboard computer.

This package contains the simulated body with the sensors and the battery that the computer reads,
the computer's attitude and position estimation and its position controller, injected failures, and
a fleet of such vehicles in one world, either in lockstep with the engine's clock or served in real
time. Protocols and modes belong to the emulators that use this package, such as
`emulated_autopilot`. Nothing here imports an emulator, or a driver for real vehicles.
"""
