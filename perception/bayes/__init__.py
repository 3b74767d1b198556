"""The `bayes` method: raw ranges, scored under every explanation, as they come.

The paper clusters segments and relaxes a model onto them. That finds a pose to a tenth of a foot and cannot decide
whether the object is a drum at all. Here segments only *propose* a body and relaxation only finds where to start; the
decision follows from the raw ranges alone:

=====================  ==============================================================================================
`state`, `parameters`  the memory and the settings, as records with named fields
`likelihood`           log likelihood of one range: rounding box, noise and outliers, as a table
`segment_pairs`        segments from pairs of readings, with their uncertainty, in a map of fixed size
`range_fit`            circle and line: predicted range, evidence, robust fit
`circle_posterior`     mean and covariance of a circle's centre under the exact likelihood
`corner_model`         two faces and their edge: a box's corner, the drum's closest rival
`polygon_likelihood`   polygon: predicted range, evidence, search for the pose
`polygon_posterior`    mean and covariance of a polygon's pose
`polygon_job`          work in quanta: what takes longer than one continues in the next
=====================  ==============================================================================================

Ranges and poses are in the odometry frame; a range ≥ `range_fit.FAR` means that nothing was heard. Evidence is in
nats: the log of how much likelier the readings are under an explanation than if something else, anywhere in range,
had answered. Kernels are pure and allocate nothing.
"""
