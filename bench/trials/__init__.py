"""Trials of the whole process or of a part in generated rooms, compared with the truth."""
