"""A small made-up robot, the Chirp, whose making docs/extending.md leads through; it is under the contract."""
