"""The programs that HiGHS solves: columns of paths or arcs, rows of conflicts and of the layout term."""
