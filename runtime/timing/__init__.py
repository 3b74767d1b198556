"""When a cycle runs, what it costs, and what delayed it: clocks, timers, pacing and measurements."""
