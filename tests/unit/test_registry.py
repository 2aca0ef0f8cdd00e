"""The registry of methods: what can be registered, and names, strengths and settings as text."""

from dataclasses import dataclass

import pytest

from evenhand.core import plugins
from evenhand.core.errors import InputError
from evenhand.methods import registry
from support.plugins import SOURCE
from support.refusals import refused


class Bare:
    def begin(self, scheme):
        return None

    def teach(self, epoch, memory):
        return epoch.reward, memory


def fresh(**fields):
    return type("Fresh", (Bare,), dict(vars(Bare)) | {"__module__": __name__} | fields)


class TestRegistering:
    def test_a_bare_class_becomes_a_method(self, registered):
        kind = registered("mine", strength=0.3, label="Mine!", colour="red")(fresh())
        made = registry.create("mine")
        assert (type(made), made.strength) == (kind, 0.3)
        assert registry.create("mine@0.1") == kind(strength=0.1)
        assert registry.names()[-1] == "mine"
        entry = registry.entry("mine")
        assert (entry.label, entry.colour, entry.strength, entry.own) == (
            "Mine!", "red", "strength", False,
        )  # fmt: skip

    def test_without_a_strength_there_is_none(self, registered):
        registered("mine")(fresh())
        with refused("unsupported strength", "1"):
            registry.create("mine@1")

    def test_another_field_may_be_the_strength(self, registered):
        @registered("mine", field="price")
        @dataclass(frozen=True)
        class Mine(Bare):
            price: float = 2.0

        assert registry.create("mine@3") == Mine(price=3.0)
        assert registry.strength_of(Mine()) == 2.0

    def test_a_cell_that_is_run_again_replaces_its_class(self, registered):
        first = registered("mine")(fresh())
        second = registered("mine")(fresh())
        assert type(registry.create("mine")) is second is not first

    @pytest.mark.parametrize(
        ("name", "make", "said"),
        [
            ("levelup", fresh, "method 'levelup' is there already, with Evenhand: choose another"),
            ("", fresh, "method '': give a name of letters"),
            ("a b", fresh, "method 'a b': give a name of letters"),
            ("mine@2", fresh, "method 'mine@2': give a name of letters"),
            ("mine", lambda: fresh(teach=None), "method 'mine' has no teach: add it to Fresh"),
            ("mine", lambda: fresh(__init__=lambda self: None), "'mine' has an __init__: make its"),
            ("mine", lambda: dataclass(fresh()), "'mine' is a dataclass that can change: make it"),
            (
                "mine",
                lambda: dataclass(frozen=True)(fresh(__annotations__={"a": float})),
                "method 'mine': give a a default",
            ),
        ],
    )
    def test_what_cannot_be_one(self, registered, name, make, said):
        with pytest.raises(InputError, match=said):
            registered(name)(make())
        assert "mine" not in registry.names()

    def test_twice(self, registered):
        registered("mine")(fresh())
        other = type("Other", (Bare,), dict(vars(Bare)) | {"__module__": "elsewhere"})
        with pytest.raises(InputError, match=f"'mine' is there already, by {__name__}: choose"):
            registered("mine")(other)

    def test_settings_that_can_change(self, registered):
        @registered("mine")
        @dataclass(frozen=True)
        class Mine(Bare):
            parts: tuple = (1, 2)

        with refused("type settings", "'mine'"):
            registry.as_method(Mine(parts=[1]))  # type: ignore[arg-type]
        assert registry.restored(registry.described(Mine())) == Mine()
        assert registry.changed(Mine(), {"parts": "3,4"}) == Mine((3, 4))


def test_the_source_is_part_of_what_is_written_down(registered, tmp_path, monkeypatch):
    monkeypatch.setattr(plugins, "_files", {})
    monkeypatch.setenv(plugins.VARIABLE, "")
    file = tmp_path / "mine.py"
    found = []
    for text in (SOURCE, SOURCE, SOURCE + "# edited\n"):
        file.write_text(text)
        plugins._files.clear()
        registry._entries.pop("mine", None)
        plugins.load_plugin(file)
        found.append(registry.described(registry.create("mine")))
    assert found[0] == found[1]
    assert found[0] | {"source": None} == found[2] | {"source": None}
    assert found[0]["source"] != found[2]["source"] is not None
    assert registry.described(registry.create("levelup"))["source"] is None


def test_a_failing_plugin_registers_a_sentence(registered, tmp_path, monkeypatch):
    monkeypatch.setattr(plugins, "_files", {})
    monkeypatch.setenv(plugins.VARIABLE, "")
    file = tmp_path / "twice.py"
    file.write_text(SOURCE.replace('"mine"', '"levelup"'))
    with refused(
        "duplicate method",
        "twice.py",
        "'levelup'",
    ):
        plugins.load_plugin(file)


@pytest.mark.parametrize(
    ("text", "parted"),
    [("levelup", ("levelup", None)), ("levelup@2", ("levelup", 2.0)), ("ggf@-0", ("ggf", 0.0))],
)
def test_name_and_strength(text, parted):
    assert registry.parted(text) == parted


@pytest.mark.parametrize("strength", [0.1, 1 / 3, 1e-9, 2.0, 12345678.9])
def test_a_strength_is_written_so_that_it_comes_back(strength):
    assert registry.parted(registry.spelled("levelup", strength)) == ("levelup", strength)


def test_settings_as_text():
    penalty = registry.create("penalty")
    assert registry.changed(penalty, {"lam": "0.25", "credit": "epoch"}) == registry.create(
        "penalty", lam=0.25, credit="epoch"
    )
    levelup = registry.create("levelup")
    assert registry.changed(levelup, {"windows": "2", "guarded": "false"}) == registry.create(
        "levelup", windows=2, guarded=False
    )
    for field, text, said in (
        ("windows", "2.5", "windows of levelup is '2.5': give a whole number"),
        ("guarded", "no", "guarded of levelup is 'no': give true or false"),
        ("shrink", "x", "shrink of levelup is 'x': give a number"),
        ("lam", "1", "unknown setting of levelup 'lam'"),
    ):
        with pytest.raises(InputError, match=said):
            registry.changed(levelup, {field: text})
