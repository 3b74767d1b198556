"""A run on one page of HTML that needs nothing else: tables, pictures, stats and settings."""
