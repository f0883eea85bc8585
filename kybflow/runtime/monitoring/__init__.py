"""What measurements are worth: which can be true, whether a body or a camera is lost, frozen, moved
or exchanged; and whether the ground carries a vehicle. What counts as found is in `findings`.
Called by a vehicle and its knowledge; decides nothing.
"""
