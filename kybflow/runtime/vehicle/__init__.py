"""One vehicle, composed: what it knows, what it decides, what it sends. The engine calls `sense`
and `act`.
"""
