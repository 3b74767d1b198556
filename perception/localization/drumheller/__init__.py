"""The ring located in a known room from one stand, after Drumheller (1987), [6] of the paper."""
