"""Running a fault, measuring its outcome, and reporting it against what is promised."""
