"""What measurements are worth: which can be true, whether a body or a camera is lost, frozen, moved
or exchanged. What counts as found is in `findings`. Called by a vehicle's knowledge; decides
nothing.
"""
