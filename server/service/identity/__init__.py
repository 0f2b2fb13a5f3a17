"""Person identities: maps every camera's tracks to one persistent number per person."""
