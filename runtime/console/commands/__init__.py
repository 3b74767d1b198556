"""Commands of operators: one registry of what a page may ask for, and what is done about each request."""
