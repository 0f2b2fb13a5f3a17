"""Appearance compared within a camera and between cameras."""
