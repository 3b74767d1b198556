"""Recordings of runs: written beside the run and never in its way, read back to the bit.

A recording is an MCAP file whose messages are JSON, so that any MCAP reader opens it: `forms` and `channels` say what
is in it, `recorder` and `writer` keep it, `folder` bounds what is kept, `salvage`, `reading` and `recover` read it in
whatever state it is, and `rerun` runs the step over it again.
"""
