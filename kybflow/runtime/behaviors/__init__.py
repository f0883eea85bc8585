"""Behaviors: what a vehicle does in a state of its mission, one per file. A behavior returns a
setpoint in every tick, sends nothing itself, and is independent of other behaviors. The catalog
finds them; a vehicle's behavior runner runs them."""
