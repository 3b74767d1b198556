"""The `bayes` method: Bayesian comparison of explanations on the raw ranges.

The paper clusters segments and relaxes a model onto them. That locates a pose to a tenth of a foot, but cannot decide
whether the object is a drum at all. Here segments only *propose* a body, and relaxation only finds a start; the raw
ranges alone decide:

=======================  ============================================================================================
`parameters`             the numbers that tune the method; those of polygons are in `polygon_parameters`
`state`                  the memory, as records with named fields
`settings_record`        the settings in the same form; `kernel_settings` fills them in
`likelihood`             log likelihood of one range: rounding box, noise and outliers, as a table
`segment_pairs`          segments from pairs of readings, with their uncertainty, in a map of fixed size
`range_fit`              circle and line: predicted range, evidence, robust fit
`circle_posterior`       mean and covariance of a circle's centre under the exact likelihood
`corner_model`           two faces and their edge: a box's corner, the drum's closest rival
`polygon_likelihood`     polygon: predicted range, evidence, search for the pose
`polygon_posterior`      mean and covariance of a polygon's pose
`polygon_job`            work in quanta: a longer job continues in the next quantum
=======================  ============================================================================================

Ranges and poses are in the odometry frame; a range ≥ `range_fit.FAR` means no echo. Evidence is in nats:
the log ratio of the readings' likelihood under an explanation to that of an echo from something else, anywhere in
range. Kernels are pure and allocate nothing.
"""
