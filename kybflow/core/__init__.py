"""What everything is made of: signals, geometry, units, parameters, files and errors. Knows nothing
of the rest of kybflow; anybody may import it.
"""
