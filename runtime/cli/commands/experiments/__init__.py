"""`echolocate experiment`: the paper's experiments and others, in virtual time."""
