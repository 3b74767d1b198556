"""Tests of the pose by maps of a few metres of way."""
