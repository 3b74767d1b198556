"""Connected browsers: their send queues, the hub that lists them, and control of the robot."""
