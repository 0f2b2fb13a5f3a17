"""The configuration of a site: sections, loading, validation."""
