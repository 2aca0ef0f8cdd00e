"""The restaurant: scene, physics, senses, task, and the Gymnasium environments.

Importing it makes ``evenhand/Restaurant-v0`` known to Gymnasium, where that is installed.
"""

from importlib.util import find_spec

if find_spec("gymnasium") is not None:
    from evenhand.restaurant.registration import register

    register()
