"""Recorded frames of a walk over the tags to corrections of lens, mount and map, with their spread:
the equations (`model`), their solution (`adjust`), and finding tags in the frames (`walk`)."""
