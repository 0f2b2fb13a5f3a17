"""The network of a window: observations, objects, costs and conflicts (paper II.B)."""
