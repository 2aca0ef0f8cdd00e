"""Worlds of one's own: identities, shares, facts, issues, registered scenarios and policies."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import evenhand as ev
from evenhand.core import plugins
from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.restaurant import people, serve_people, worlds
from evenhand.restaurant.people import IDENTITIES, Table, population
from evenhand.restaurant.worlds import World
from evenhand.training import evaluate, policy, run_folder, train
from evenhand.training.settings import TrainSettings, settings_of
from support.refusals import refused

TONGUE = ev.Identity("language", ("local", "foreign"))
BANDS = ev.Identity("age", ("Elder", "Younger"))


@pytest.fixture
def registries(monkeypatch):
    """What a test registers is gone after it."""
    monkeypatch.setattr(worlds, "_SCENARIOS", dict(worlds._SCENARIOS))
    monkeypatch.setattr(policy, "_POLICIES", dict(policy._POLICIES))


# --- people ---


def test_shares_replace_those_of_the_population():
    world = World(population="us", shares={"disability": (0.4, 0.6)})
    assert world.people.marginal("disability") == (0.4, 0.6)
    assert world.people.marginal("race") == population("us").marginal("race")
    codes = people.sample(world.people, 4000, np.random.default_rng(0))
    assert (codes[:, 3] == 0).mean() == pytest.approx(0.4, abs=0.03)
    # whoever is drawn otherwise stays who it was
    before = people.sample(population("us"), 4000, np.random.default_rng(0))
    np.testing.assert_array_equal(np.delete(codes, 3, axis=1), np.delete(before, 3, axis=1))


def test_what_depends_on_an_identity_that_is_gone_keeps_its_overall_shares():
    alone = population("us").altered((IDENTITIES[3], TONGUE), {"language": (0.9, 0.1)})
    assert alone.marginal("disability") == pytest.approx(population("us").marginal("disability"))
    assert not alone.tables
    kept = population("us").altered((*IDENTITIES, TONGUE), {})
    assert isinstance(kept.tables["disability"], Table)
    assert kept.marginal("language") == (0.5, 0.5)


def test_the_five_identities_are_told_by_the_names_of_groups():
    identities = (TONGUE, BANDS, IDENTITIES[3])
    codes = np.array([[1, 0, 0], [0, 1, 1]])
    # an elder in a wheelchair; "Younger" is no group of the restaurant: an adult
    np.testing.assert_array_equal(
        people.known(codes, identities), [[0, 0, 4, 0, 0], [0, 0, 2, 1, 0]]
    )
    onehot = people.encode(codes, identities)
    np.testing.assert_array_equal(onehot, [[0, 1, 1, 0, 1, 0], [1, 0, 0, 1, 0, 1]])
    np.testing.assert_array_equal(people.decode(onehot, identities), codes)
    assert people.labels(codes, identities)["age"] == ["Elder", "Younger"]


def test_needs_and_tips_go_by_what_is_known():
    """Elders notice a response within 1.2 m only: whoever is served at 1.25-1.5 m has none."""
    world = World(needs=1.0, identities=(TONGUE, BANDS))
    done = serve_people.serve_people(
        world, lambda seen, _: 1.0 * (5 * seen[:, -3] <= 1.45), 120, np.random.default_rng(0)
    )
    elder = done.codes[:, 1] == 0
    assert done.observation.shape[-1] == 2 + 2 + 3
    assert done.facts.responded[~elder].mean() > 0.95
    assert done.facts.responded[elder].mean() < 0.3


def test_who_is_missed_by_two_causes_is_missed_by_either():
    world = World(missed={"disability=Yes": 0.3, "age=Child": 0.5})
    codes = np.array([[0, 0, 2, 1, 0], [0, 0, 2, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 0]])
    missed = world.also_missed(codes)
    assert missed is not None
    np.testing.assert_allclose(missed, [0, 0.3, 0.5, 1 - 0.7 * 0.5])
    assert World().also_missed(codes) is None


# --- facts and issues ---


class TestGraded:
    def issue(self, rule):
        return ev.own_issue("slow", ["steps"], rule, graded=True)

    def table(self, world=None):
        world = world or World()
        done = serve_people.serve_people(world, ev.ScriptedRobot(), 20, np.random.default_rng(2))
        return serve_people.table(done, world, "even")

    def test_severities_are_averaged(self):
        table = self.table()
        scheme = World(issues=(self.issue(lambda steps: steps / 300),)).scheme
        x = scheme.indicators(table)[:, 0]
        np.testing.assert_allclose(x, table.fact("steps") / 300)
        counts = scheme.count(table)
        yes = table.identity("disability")[0] == 0
        assert counts.inside_x[14, 0] == pytest.approx(x[yes].sum())
        rounded = counts.rounded()
        assert rounded.inside_x[14, 0] == round(float(x[yes].sum()))
        np.testing.assert_array_equal(rounded.inside_n, counts.inside_n)

    @pytest.mark.parametrize(
        ("rule", "said"),
        [
            (lambda steps: steps, r"severity \d+ in service 0: give 0 to 1"),
            (lambda steps: steps / np.nan, "severity nan in service 0"),
            (lambda steps: 0.5, r"array of shape \(\) for 20 services: give a severity for each"),
        ],
    )
    def test_what_is_no_severity(self, rule, said):
        with pytest.raises(InputError, match=said):
            World(issues=(self.issue(rule),)).scheme.indicators(self.table())


@pytest.mark.parametrize(
    ("tell", "said"),
    [
        (lambda done: np.zeros(3), r"fact 'held' came as an array of shape \(3,\) for 5 services"),
        (lambda done: done.facts.steps * -1.0, r"fact 'held' is -\d+ in service 0: give a finite"),
    ],
)
def test_a_fact_that_cannot_be(tell, said):
    world = World(facts={ev.Fact("held", float, least=0.0): tell})
    done = serve_people.serve_people(world, ev.ScriptedRobot(), 5, np.random.default_rng(0))
    with pytest.raises(InputError, match=said):
        serve_people.table(done, world, "even")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"missed": {"disability=No way": 0.3}}, "unknown group in missed 'disability=No way'"),
        ({"missed": {"disability=Yes": 1.0}}, "missed says 1.0 of disability=Yes: give a share"),
        ({"shares": {"language": (0.5, 0.5)}}, "unknown identity in shares 'language'"),
        ({"shares": {"disability": (0.5, 0.6)}}, "disability: shares must sum to 1"),
        ({"interval": 7}, "interval is 7"),
        ({"noise": 2.0}, "noise is 2.0"),
        ({"issues": (ev.own_issue("odd", ["mood"], np.isnan),)}, "unknown fact that issue 'odd'"),
        ({"identities": (TONGUE, TONGUE)}, "'language' stands twice among the identities"),
    ],
)
def test_an_impossible_world(wrong, said):
    with pytest.raises(InputError, match=said):
        World(**wrong)


# --- scenarios ---


@pytest.mark.usefixtures("registries")
class TestRegistering:
    def test_a_world_or_a_function_that_makes_it_once(self):
        made = []

        def make():
            made.append(1)
            return World(noise=0.1)

        ev.register_scenario("made", world=make)
        ev.register_scenario("given", world=World(tips=0.5))
        assert worlds.names()[-2:] == ("made", "given")
        assert ev.scenario("made") == ev.scenario("made") == World(noise=0.1)
        assert made == [1]
        assert ev.scenario("given+made") == World(noise=0.1, tips=0.5)
        assert worlds.ordered("given+made") == "made+given"
        with refused("conflict scenario"):
            ev.scenario("given+tips")
        assert TrainSettings("service", scenario="made", population="us").world == World(
            "us", noise=0.1
        )

    def test_a_reference_belongs_to_its_own_scenario(self):
        ev.register_scenario("with", world=World(noise=0.1), reference=ev.ScriptedRobot())
        ev.register_scenario("without", world=World(dropout=0.3))
        assert ev.scenario("with").robot_to_compare_with() == ev.ScriptedRobot()
        for name in ("without", "with+tips"):
            with refused("missing reference"):
                ev.scenario(name).robot_to_compare_with()

    @pytest.mark.parametrize("name", ["even", "twice"])
    def test_a_name_that_is_taken(self, name):
        ev.register_scenario("twice", world=World())
        with pytest.raises(InputError, match=f"there is a scenario '{name}' already"):
            ev.register_scenario(name, world=World())

    @pytest.mark.parametrize("name", ["a+b", "a/b", "", ".", None, "a b", "@"])
    def test_a_name_that_cannot_be_one(self, name):
        with refused("format scenario"):
            ev.register_scenario(name, world=World())
        with refused("format policy"):
            ev.register_policy(name, policy.mlp)

    def test_what_is_no_world(self):
        with refused("type world", "'us'"):
            ev.register_scenario("wrong", world="us")  # type: ignore[arg-type]
        ev.register_scenario("late", world=lambda: {"noise": 1})  # type: ignore[arg-type,return-value]
        with refused("type world", "'late'"):
            ev.scenario("late")

    def test_an_edited_file_is_another_run(self, tmp_path, monkeypatch):
        monkeypatch.setattr(plugins, "_files", {})
        monkeypatch.delenv(plugins.VARIABLE, raising=False)
        file, prints = tmp_path / "mine.py", []
        for noise in (0.1, 0.2):
            file.write_text(
                "import evenhand as ev\n"
                f"ev.register_scenario('mine', world=lambda: ev.World(noise={noise}))\n"
                "ev.register_policy('thin', lambda *a: None)\n"
            )
            plugins._files.clear()
            worlds._SCENARIOS.pop("mine", None)
            policy._POLICIES.pop("thin", None)
            ev.load_plugin(file)
            settings = settings_of("service", "ppo", "service")
            mine = replace(settings, scenario="mine")
            prints.append([run_folder.fingerprint(one) for one in (settings, mine)])
            assert worlds.sources("mine").keys() == {"scenario mine"}
            assert policy.sources("thin").keys() == {"policy thin"}
        assert prints[0][0] == prints[1][0]
        assert prints[0][1] != prints[1][1]
        assert worlds.sources("even") == policy.sources("mlp") == {}


# --- policies ---


class Wide(eqx.Module):
    """Walks and responds by one matrix; no actor of its own."""

    weight: jax.Array
    name: str = eqx.field(static=True, default="wide")

    def log_probabilities(self, obs):
        return jax.nn.log_softmax(jnp.asarray(obs) @ self.weight[:, :2])

    def value(self, obs):
        return jnp.asarray(obs) @ self.weight[:, 2]


class Flat(Wide):
    def value(self, obs):
        return jnp.asarray(obs) @ self.weight


def wide(inputs, settings, rng):
    weight = 0.1 * rng.standard_normal((inputs, 3)).astype(np.float32)
    return Wide(jnp.asarray(weight))


@pytest.mark.usefixtures("registries")
class TestPolicies:
    def test_an_own_policy_learns_serves_and_comes_back(self, tmp_path):
        ev.register_policy("wide", wide)
        settings = replace(
            settings_of("service", "ppo", "levelup", epochs=2),
            people=8,
            policy=policy.PolicySettings(kind="wide"),
        )
        state = run_folder.execute(tmp_path / "run", settings, train.shipped_detector(settings))
        again, loaded = run_folder.load_policy(tmp_path / "run")
        assert again == settings
        before, after, back = (
            np.asarray(jax.tree.leaves(one.policy)[0])
            for one in (train.untrained(settings), state, loaded)
        )
        np.testing.assert_array_equal(back, after)
        assert not np.array_equal(after, before)
        assert len(evaluate.serve_policy(loaded, settings, 30, 4)) == 30

    @pytest.mark.parametrize(
        ("make", "said"),
        [
            (lambda *a: {"weight": jnp.zeros(3)}, "lacks log_probabilities or value"),
            (lambda *a: {"size": 3.0}, "holds 3.0 among its weights: keep arrays there"),
            (
                lambda inputs, *a: Flat(jnp.zeros((inputs, 3))),
                r"gives log_probabilities of shape \[1, 2\] and value of shape \[1, 3\] for one",
            ),
        ],
    )
    def test_what_cannot_be_trained(self, make, said):
        ev.register_policy("odd", make)
        chosen = policy.PolicySettings(kind="odd")
        with pytest.raises(InputError, match=said):
            policy.make_policy(25, chosen, np.random.default_rng(0))

    def test_unknown_and_taken_names(self):
        with refused("unknown policy", "'mpl'", "'mlp'"):
            policy.PolicySettings(kind="mpl")
        with refused("duplicate policy", "'mlp'"):
            ev.register_policy("mlp", wide)


# --- testing where it was not trained ---


@pytest.mark.usefixtures("registries")
class TestElsewhere:
    def test_scenario_and_population(self):
        settings = TrainSettings("service", scenario="perception", population="us")
        assert settings.elsewhere(None, None) == settings.world
        assert settings.elsewhere(None, "fairface") == World("fairface", perception=1.0)
        assert settings.elsewhere("minority", None) == World("us", needs=1.0)
        assert settings.elsewhere("tips", None) == World(tips=1.0)

    def test_a_policy_serves_in_another_scenario_but_not_other_identities(self):
        settings = TrainSettings("service", scenario="even")
        state, world = train.untrained(settings), settings.elsewhere("minority", None)
        table = evaluate.serve_policy(state, settings, 60, 1, world)
        assert {*table.fact("scenario")} == {"minority"}
        assert table != evaluate.serve_policy(state, settings, 60, 1)
        ev.register_scenario("tongues", world=World(identities=(TONGUE,)))
        with refused("conflict scenario", "'tongues'"):
            evaluate.serve_policy(state, settings, 60, 1, settings.elsewhere("tongues", None))


# --- detectors in such worlds ---


@pytest.mark.usefixtures("registries")
def test_where_the_shipped_detector_knows_nobody_no_epoch_is_called_biased():
    ev.register_scenario("tongues", world=World(identities=(TONGUE,)))
    settings = replace(
        settings_of("service", "ppo", "levelup", epochs=1), scenario="tongues", people=8
    )
    assert train.shipped_detector(settings) is None
    record = next(iter(train.train(settings, None)))
    assert (record.numbers["biased_detector"], record.numbers["probability"]) == (False, None)
    asking = replace(settings, method=registry.create("penalty"))
    with pytest.raises(InputError, match="method penalty asks a detector"):
        train.shipped_detector(asking)


@pytest.mark.usefixtures("registries")
def test_weights_of_issues_are_as_many_as_issues():
    slow = ev.own_issue("slow", ["steps"], lambda steps: steps > 200)
    ev.register_scenario("slow", world=World(issues=(*ev.paper_issues(), slow)))
    settings = TrainSettings("service", scenario="slow")
    assert settings.tau == (1.0,) * 5
    with refused("conflict tau", "5"):
        TrainSettings("service", scenario="slow", tau=(1.0, 1.0, 1.0, 2.0))
