"""Files that pages handle: recordings of the folder, and what child processes make of them."""
