"""The commands, a room each: fields are the options, their words the help; ``run`` does it.

Modules here import nothing heavy before ``run``, so that help and complaints come at once.
"""
