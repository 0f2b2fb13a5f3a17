"""Who watches: limits, fair shares, HLS sessions, and the traffic to all of them."""
