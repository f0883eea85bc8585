"""The world and the vehicle as data: shapes, obstacles, printed tags, cameras, the airframe, and
the context that a vehicle's parts receive. Nothing here flies or opens a file: point clouds and
occupancy maps are made of the text that the compiler has read.
"""
