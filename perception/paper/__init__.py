"""The paper's method (Santamaria & Arkin 1995): segments, clusters, relaxation, recognition."""
