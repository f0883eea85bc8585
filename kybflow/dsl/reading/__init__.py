"""Text to nodes with spans, and a node to one typed value. Opens files, bounded; decides nothing
about missions.
"""
