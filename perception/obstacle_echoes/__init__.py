"""The echoes that stay obstacles: the last ones of each sensor, and those that fell silent on approach."""
