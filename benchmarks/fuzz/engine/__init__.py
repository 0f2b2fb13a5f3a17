"""The fuzzing engine: targets, mutations, event loops, and the process that runs a target."""
