"""A picture of the page, for the documents."""
