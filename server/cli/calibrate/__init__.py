"""``myview calibrate``: homographies from marked points or from walks."""
