"""A map of where echoes come from, whatever the shape: cells, and out of them straight pieces and polylines."""
