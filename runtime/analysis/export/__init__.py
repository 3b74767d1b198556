"""Export of runs for other programs: tables for spreadsheets and data frames, Foxglove, ROS 2, ring logs."""
