"""Behaviors: what a vehicle does in a state of its mission, one a file. Each gives a setpoint a
tick, sends nothing and knows no other behavior. The catalog finds them; a vehicle's behavior runner
runs them."""
