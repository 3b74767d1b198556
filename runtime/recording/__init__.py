"""Recordings of runs: written on a thread so that the control loop never waits, and replayed bit for bit.

A recording is an MCAP file with JSON messages, so any MCAP reader opens it. `schema` and `channels` define its
content, `recorder` and `writer` write it, `storage` limits the disk space, `mcap_scanner`, `reader` and `recovery`
read it even damaged, `replayer` runs the step over it again, and `verification` compares the two. The modules
`ring_log*` are about the CSV form.
"""
