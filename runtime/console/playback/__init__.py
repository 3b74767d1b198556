"""Recordings shown in the console: a cursor that replays, the worker process that runs it, and its client."""
