"""Recordings shown in the console: a cursor, a worker process that replays, and its client."""
