"""Set-up of a site: finds cameras, tries them, proposes settings, writes the configuration."""
