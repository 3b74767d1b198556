"""Figures of a run as in the paper. The only package that imports matplotlib."""
