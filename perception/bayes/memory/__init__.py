"""What the Bayesian method remembers and is given: its records, their bounds, and the numbers that tune it."""
