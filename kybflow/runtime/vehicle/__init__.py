"""One vehicle, composed of its knowledge, its decisions and its output. The engine calls
`Vehicle.sense` and `Vehicle.act`.
"""
