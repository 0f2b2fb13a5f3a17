"""Methods to track people on a floor that several cameras share."""
