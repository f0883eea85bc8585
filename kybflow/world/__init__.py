"""Facts of the place and the vehicle: shapes, obstacles, printed tags, cameras, an airframe and
what a vehicle's parts may know of it. Values only; nothing here flies or reads a file.
"""
