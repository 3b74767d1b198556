"""The conventions of a ring log from any program: headings, units, what stands for silence, repeated values.

`options` is what a user may say, `reading` yields the converted firings; the other modules decide from the data.
"""
