"""Other views that a camera is turned to: noticed, and located by what they share with those before."""
