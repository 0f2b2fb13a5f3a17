"""Heuristics for integer answers: rounding, local search, recombination and candidates without a program."""
