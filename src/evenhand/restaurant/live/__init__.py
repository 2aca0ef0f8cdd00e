"""The running restaurant in a browser: services to look on at, never to learn from or to judge by.

Nothing that is done in the viewer changes what happens: the physics runs in a room of its own.
"""
