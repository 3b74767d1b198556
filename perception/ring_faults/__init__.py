"""Detection of a ring that lies as a whole: its readings contradict its own motion, or repeat old ones."""
