"""Runs in the forms of other programs: tables for spreadsheets and data frames, Foxglove, ROS 2, ring logs."""
