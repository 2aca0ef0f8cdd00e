"""The restaurant: scene, physics, senses, task, and the Gymnasium environments.

Importing it makes ``evenhand/Restaurant-v0`` known to Gymnasium.
"""

from evenhand.restaurant.registration import register

register()
