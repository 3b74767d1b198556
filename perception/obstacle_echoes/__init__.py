"""The echoes that stay obstacles: the last of each sensor, those that fell silent, and walls beside a ring's gaps."""
