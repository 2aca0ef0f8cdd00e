"""The restaurant: scene, physics, senses, task, and the Gymnasium environments.

Importing it makes ``evenhand/Restaurant-v0`` known to Gymnasium.
"""

from evenhand.registration import register

register()
