"""Text to nodes with spans, and a node to one typed value; files that a mission names, such as
calibrations and tables of tags. Opens files, bounded, and decides nothing about missions. The later
passes call it, and so does whoever lists missions and libraries.
"""
