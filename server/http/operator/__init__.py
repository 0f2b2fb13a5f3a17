"""The operator's page and its addresses."""
