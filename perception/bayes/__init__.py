"""The `bayes` method: raw ranges, compared under every explanation one has, as they come.

The paper clusters segments and relaxes a model onto them. That finds a pose to a tenth of a foot and cannot say
whether the thing is a drum at all. Here segments only *propose* a body and relaxation only finds the basin; what is
believed follows from the raw ranges alone:

=====================  ==============================================================================================
`likelihood`           what one range is worth: rounding box, noise and outliers, as a table
`pairs`                segments from pairs of readings, with their uncertainty, in a map of fixed size
`contact`              circle and line: predicted range, evidence, robust fit
`posterior`            where a circle's centre is, and how well known: mean and covariance of the exact likelihood
`wedge`                two faces and their edge: what a box's corner looks like, the drum's closest rival
`polygon`              polygon: predicted range, evidence, search for the pose
`polygon_posterior`    where a polygon is, which way it faces, and how well both are known
`polygon_job`          the same work in quanta: what takes longer than one goes on in the next
`entry`                how Python calls all this: memory and settings by one handle
=====================  ==============================================================================================

A *reading* is a row (x, y, ux, uy, r): the sensor's place (m), its axis as a unit vector, its raw range (m), all in
the odometry frame; r ≥ `contact.FAR` says that nothing was heard. Evidence is in nats: the log of how much likelier
the readings are under an explanation than if something else, anywhere in range, had answered. Kernels are pure,
allocate nothing and take all lengths in the same unit, whichever it is.
"""
