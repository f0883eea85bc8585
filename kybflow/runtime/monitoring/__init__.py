"""How far measurements can be trusted: which can be true, whether a body or a camera is lost,
frozen, moved or exchanged; and whether the ground carries a vehicle. Called by a vehicle and its
knowledge; decides nothing.
"""
