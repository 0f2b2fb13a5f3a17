"""Failover between two best-view services of a site, measured against the promises."""
