"""Connected browsers: their send queues, the hub, and who holds control."""
