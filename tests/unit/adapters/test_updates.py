"""Table and caption of the updates of another library's learner."""

import numpy as np

from evenhand.adapters.page import Examined, caption, updates_table
from evenhand.methods.beyond.reflection import Reflection, ReflectionSettings
from support.refusals import refused


def reflection(change, p, alarm=False):
    table = np.array([[change]])
    return Reflection(
        ("side",), ("late",), table, table, table, p, alarm, "side", "late", ("left", "top")
    )


SETTINGS = ReflectionSettings(rate=0.5, history=2)
RUN = Examined(
    [reflection(0.1, 1.0), reflection(-0.2, 0.5, True), reflection(np.nan, 1 / 3)], SETTINGS
)


def test_by_hand():
    found = updates_table({"a": RUN})
    np.testing.assert_array_equal(found["projection"], [0.1, -0.2, np.nan])
    assert found["epoch"].tolist() == [0, 1, 2]
    assert found["earlier"].tolist() == [0, 1, 2]
    # the first ranks 1 of 1, which is above the rate
    assert found["able"].tolist() == [0, 1, 1]
    assert found["alarm"].tolist() == [0.0, 1.0, 0.0]
    assert found["favoured"].tolist() == [None, "left, top", None]


def test_the_caption_counts_alarms_beside_what_chance_gives():
    runs = {"a": RUN, "b": Examined([reflection(0.1, 1.0)], SETTINGS)}
    text = caption(updates_table(runs), runs)
    assert "an alarm is raised from 50.0 % down" in text.replace("\N{NO-BREAK SPACE}", " ")
    assert text.endswith("a, 1 of 2 (1.0); b, none could be raised.")


def test_no_update():
    with refused("empty update"):
        updates_table({"a": Examined([], SETTINGS)})
