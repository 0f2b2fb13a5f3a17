"""From the pulse to the browser, stage by stage."""
