"""The `bayes` method: Bayesian comparison of explanations on the raw ranges.

The paper clusters segments and relaxes a model onto them. That locates a pose to a tenth of a foot, but cannot decide
whether the object is a drum at all. Here segments only *propose* a body, and relaxation only finds a start; the raw
ranges alone decide:

=======================  ============================================================================================
`memory`                 the records of what is remembered and of the settings, and the numbers that tune the method
`inference`              what every explanation shares: likelihood of a range, noise, prediction, kept readings
`segments`               outline segments from pairs of readings: they propose bodies
`circles`, `polygons`    initiation, fit, alternatives on the same readings, and posterior of the two kinds of bodies
`walls`                  walls and corners of the whole drive
`tracks`                 observed, refined in quanta, named, archived, edited by the operator
`reports`                objects for those outside, what explains an echo, and evidence
=======================  ============================================================================================

Each imports only from those above it; `segments`, `circles`, `polygons` and `walls` know nothing of each other (a
contract in pyproject.toml).

Ranges and poses are in the odometry frame; a range ≥ `FAR` means no echo. Evidence is in nats:
the log ratio of the readings' likelihood under an explanation to that of an echo from something else, anywhere in
range. Kernels are pure and allocate nothing.
"""
