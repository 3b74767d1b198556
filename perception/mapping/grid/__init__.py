"""The evidence grid: what the cells around the robot have answered, from which directions.

`directed` is the default; `moravec_elfes` (1985) and `elfes` (1989) are the published methods beside it.
"""
