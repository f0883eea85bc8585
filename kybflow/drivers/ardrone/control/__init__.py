"""Control of one drone: flight, moves, acts, configuration and round trips, without sockets."""
