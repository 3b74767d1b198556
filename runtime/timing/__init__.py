"""When a cycle runs, what it costs, and who is to blame where it is late: clocks, waking, pacing, and the books."""
