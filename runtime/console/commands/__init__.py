"""Messages from the page: their types, their validation, and what carries each of them out."""
