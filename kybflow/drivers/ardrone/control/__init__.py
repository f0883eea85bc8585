"""Control of one drone: flight, moves, actions, configuration and round trips, without sockets."""
