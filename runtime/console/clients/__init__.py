"""Connected browsers: their send queues, the hub that knows them all, and control of the robot."""
