"""Many runs at once: the grid of a study, its results, and the workers that make it."""
