"""A run gone over once more and kept as a whole: what pictures, reports and exports are made from.

`form` says what is known of a run, `gathering` collects it cycle by cycle, `sources` reads recordings and ring logs.
"""
