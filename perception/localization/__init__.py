"""Where the robot is in a known room of walls: Drumheller's method (1987), with the likelihood of all raw ranges."""
