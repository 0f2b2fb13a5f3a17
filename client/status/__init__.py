"""The status of a site, read over HTTP."""
