"""Memory and time over many frames of one tracker."""
