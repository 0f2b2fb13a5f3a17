"""``myview track``: one video, or its detections, to MOTChallenge text."""
