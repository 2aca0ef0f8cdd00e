"""``evenhand train``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL, Plugin, registered, scenario_help
from evenhand.core.errors import InputError, unknown, whole
from evenhand.core.processors import CORES, THREADS
from evenhand.methods import registry
from evenhand.methods.vocabulary import SOURCES

if TYPE_CHECKING:
    from evenhand.training.settings import TrainSettings


METHODS = f"""How the robot is to become even, and perhaps how strongly: levelup@2.
service: nothing is paid for evenness.
The paper's. score: Eq. 4. penalty: Eq. 4, times lambda in an epoch that looks biased (Eq. 5).
Ours, only with preset service. levelup: an issue costs more if it hits a worse-off group
(recommended). influence: each service costs what it adds to the total issue score. surgery: the
gradient towards evenness, without what conflicts with service.
All names: {", ".join(registry.names())}."""


POLICIES = f"""Which network serves: {registered("evenhand.training.policy", "mlp")}.
Your own are registered by `evenhand.register_policy`, in a file that --plugin names."""


@dataclass(frozen=True)
class Train:
    """Train one robot in a run folder.

    An epoch: 30 people are served, their services are scored (Eq. 1 and 2), the detector says
    whether they look biased (Eq. 3), evenness is rewarded (Eq. 4 and 5), and the policy is
    updated (Eq. 6 to 8).

    The folder keeps settings and versions (settings.json), every epoch (epochs.jsonl), every
    service (services/), what was to be seen of it (states/), and a checkpoint every 50 epochs.
    Stop it whenever you like: the same command goes on from the last checkpoint, and ends with
    the same bits.

    For instance: evenhand train --out out/run --algorithm reinforce --guidance score@1
    """

    out: Annotated[Path, arg(metavar="FOLDER")]
    """Folder of the run: a new one, or that of the same command, which then goes on."""

    preset: Literal["paper", "service"] = "service"
    """What is rewarded.
    paper: evenness (Eq. 4/5) and nothing else, as printed.
    service: good service plus evenness."""

    algorithm: Literal["reinforce", "ppo", "reinforce-all", "ppo-all"] = "ppo"
    """How the policy learns from an epoch.
    reinforce: in one step, with the critic as baseline.
    ppo: in several clipped steps.
    reinforce-all, ppo-all: the same steps, but every moment of responding is weighed by what
    would have come of it, since a walk that is simulated to its end tells."""

    guidance: Annotated[str, arg(metavar="NAME[@STRENGTH]", help=METHODS)] = "penalty"

    set: Annotated[
        tuple[str, ...], arg(metavar="SETTING=VALUE ...", help_behavior_hint=OPTIONAL)
    ] = ()
    """Settings of the method: credit=epoch and lam=0.25 with penalty, when=biased with levelup."""

    plugin: Plugin = ()

    scenario: Annotated[str, arg(metavar="NAME[+NAME]", help=scenario_help())] = "even"

    policy: Annotated[str, arg(metavar="NAME", help=POLICIES)] = "mlp"

    tau: Annotated[str, arg(metavar="NAME|A,B,C,D")] = "equal"
    """Weights of willingness, quality, priority and risk in Eq. 4 and in self-reflection.
    By name: equal, risk_first, willingness_first, risk_then_willingness.
    Or as numbers: 1,1,1,2."""

    seed: int = 0
    """Of everything random in the run; the same seed gives the same run."""

    epochs: int = 300
    """Updates."""

    people: int = 30
    """Services in one epoch; the paper has 30."""

    population: Annotated[
        str | None, arg(metavar="uniform|us|fairface", help_behavior_hint="(of the scenario)")
    ] = None
    """Where people are drawn from: all categories alike, or published shares."""

    detector: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Detector that judges every epoch, from `evenhand detect fit`.
    Without it: the one that comes along, fitted to simulated respondents, where it knows the
    scenario's issues and identities; else no epoch is called biased."""

    judges: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """What people mind: their answers (CSV, as for `evenhand detect fit`) or a detector (JSON).
    It gives the weights of the issues in Eq. 4, level-up, influence and surgery, in place of --tau.
    Columns too_near and too_far may stand in place of quality."""

    judges_source: Annotated[str, arg(metavar="WHO")] = "respondents"
    """Who gave the answers: "respondents", or "simulated respondents"; the run notes it."""

    threads: int = CORES
    """Threads that step the physics; the run is the same to the last bit on any number."""

    no_states: bool = False
    """Do not keep where everybody was (270 bytes a service), which film and replay draw from."""

    log: Annotated[
        tuple[Literal["tensorboard", "wandb"], ...] | None,
        arg(metavar="tensorboard|wandb ...", help_behavior_hint="(optional)"),
    ] = None
    """Show the numbers of every epoch elsewhere too, in the folder and nowhere else.
    tensorboard: events in tensorboard/, for TensorBoard.
    wandb: a run in wandb/, of Weights & Biases, offline."""

    def run(self, command: str) -> int:
        """Train and print where the run is."""
        if self.log == ():
            raise InputError("empty log", "--log names no sink: give tensorboard, wandb or both")
        whole("threads", self.threads, *THREADS)
        inputs.load_physics("train")
        from evenhand.core import terminal
        from evenhand.training import loggers, run_folder, train
        from evenhand.training.jax_setup import set_up_jax

        set_up_jax()
        settings = self.settings()
        if self.detector is None:
            judge = train.shipped_detector(settings)
        else:
            judge = inputs.load_detector(self.detector)
            train.check_detector(judge, settings)
            train.check_steering(settings)
        with loggers.opened(self.log or (), self.out) as note, terminal.stages() as stage:
            tell = stage(f"{self.algorithm}, seed {self.seed}", self.epochs * self.people)

            def progress(numbers: dict[str, Any]) -> None:
                tell(numbers["services"], numbers)
                note(numbers)

            run_folder.execute(
                self.out,
                settings,
                judge,
                progress=progress,
                recorded=not self.no_states,
                threads=self.threads,
            )
        print(self.out)
        return 0

    def settings(self) -> TrainSettings:
        """The settings of the run.

        Raises:
            InputError: for settings that do not exist, or do not go together.
        """
        from evenhand.methods import issue_weights
        from evenhand.training.settings import settings_of

        if self.judges_source not in SOURCES:
            raise unknown("judges-source", self.judges_source, SOURCES)
        judges = (
            None if self.judges is None else issue_weights.read(self.judges, self.judges_source)
        )
        base = settings_of(
            self.preset,
            self.algorithm,
            inputs.method(self.guidance, self.set),
            seed=self.seed,
            epochs=self.epochs,
            population=self.population,
        )
        return replace(
            base,
            people=self.people,
            tau=inputs.parse_tau(self.tau),
            judges=judges,
            scenario=self.scenario,
            policy=replace(base.policy, kind=self.policy),
        )
