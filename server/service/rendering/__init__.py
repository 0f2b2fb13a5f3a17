"""Streams that need decoding: JPEG and boxes burnt in, made by worker processes on demand.

This file imports nothing: the worker starts in a third of the time.
"""
