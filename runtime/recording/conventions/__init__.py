"""The conventions of a ring log from any program: headings, units, what stands for silence, repeated values.

`options` is what a user may say, `reading` the door; `silence`, `units` and `headings` decide from the data.
"""
