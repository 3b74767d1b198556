"""Circles: initiation, alternative explanations of the same readings, and the posterior of the centre."""
