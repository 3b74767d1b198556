"""What a terminal shows of a run while it lasts, and the keys it takes."""
