"""Where the robot is: in a known room, by Drumheller's method or firing by firing, or by what it recognised."""
