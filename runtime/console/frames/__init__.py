"""The data that the page receives: session information first, then one frame after each cycle."""
