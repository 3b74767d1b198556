"""Drift of odometry corrected by what is recognised: objects become landmarks of a filter, and ranges correct it."""
