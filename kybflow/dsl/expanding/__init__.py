"""The resolved tree to the plan as written: the target's drivers and sensors, a chain's transitions
in each of its states, cameras and solids made of their parameters. Judges each value alone; what
two of them mean together is a check. Only the compiler calls it; checks and `bind` ask it which
vehicles a flow drives and what a state is entered with.
"""
