"""One vehicle, composed of what it knows, what it decides and what it sends. The engine calls
`Vehicle.sense` and `Vehicle.act`.
"""
