"""The world and the vehicle as data: shapes, obstacles, printed tags, cameras, the airframe, and
the context that a vehicle's parts receive. Nothing here flies or opens a file; the compiler opens
the files of point clouds and occupancy maps."""
