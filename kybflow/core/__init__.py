"""Signals, geometry, units, parameters, files and errors. Imports nothing from the rest of kybflow;
every module may import it.
"""
