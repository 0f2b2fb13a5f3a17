"""Screenshots of the pages for the documents."""
