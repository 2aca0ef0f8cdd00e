"""The panel beside the picture, and what it and the simulation send each other."""

from __future__ import annotations

from dataclasses import dataclass

from mujoco.studio import messages, plugin
from mujoco.studio.dear_imgui import dear_imgui as gui

from evenhand.methods.scheme import Scheme
from evenhand.restaurant.live import words
from evenhand.restaurant.live.shift import Moment

FASTER = (1, 2, 4, 8)
"""Times real time; Studio's own control only slows down."""
_PANEL = 470.0
"""Width of the panel, pixels; at most half the page."""


@dataclass(frozen=True)
class MomentSnapshot(messages.Snapshot):
    """What the panel tells; from the simulation to the viewer."""

    moment: Moment
    faster: int


@dataclass(frozen=True)
class FasterSnapshot(messages.Snapshot):
    """How many times real time is wanted; from the viewer to the simulation."""

    faster: int


@dataclass(frozen=True)
class LookedAtEvent(messages.Event):
    """Somebody has opened the page; from the viewer to the simulation, once."""


class Panel(plugin.ViewerPlugin):
    """Tells beside the picture who is served, how it stands, and what has been counted."""

    def __init__(self, title: str, scheme: Scheme) -> None:
        self._title, self._scheme = title, scheme
        self._known: MomentSnapshot | None = None
        self._alone = True
        self._page = (0.0, 0.0)

    @messages.handler
    def on_update(self, event: messages.UpdateEvent) -> None:
        """Let the services begin; there are no updates without a browser."""
        del event
        if self._alone:
            self._alone = False
            self.viewer.send_to_sim(LookedAtEvent())

    @messages.handler
    def on_moment(self, snapshot: MomentSnapshot) -> None:
        """Keep what is to be told."""
        self._known = snapshot

    @messages.handler
    def on_build_gui(self, event: messages.BuildGuiEvent) -> None:
        """Lay out the panel."""
        del event
        if self._known is None:
            return
        moment = self._known.moment
        self._place(gui.GetIO().DisplaySize)
        shown, kept = gui.Begin("Evenhand", True)
        if not kept:  # its cross folds it up, so that it can be unfolded again
            gui.SetWindowCollapsed(True)
        if shown:
            gui.TextWrapped(self._title)
            self._build_faster(self._known.faster)
            gui.SeparatorText(f"Service {moment.number}")
            _table("person", words.person(moment.codes, self._scheme))
            gui.Separator()
            _table("progress", words.progress(moment))
            gui.SeparatorText("Issues")
            verdicts = words.verdicts(moment, self._scheme)
            _table("issues", [(f"{name}: {rule}", say) for name, rule, say in verdicts])
            for heading, outcome in (("This service", moment.outcome), ("Before", moment.last)):
                if outcome is not None:
                    gui.SeparatorText(f"{heading}: {outcome.number}")
                    gui.TextWrapped(words.ending(outcome, self._scheme))
            gui.SeparatorText("Counted so far")
            self._build_counts(moment)
        gui.End()

    def _place(self, page: gui.Vec2) -> None:
        """At the right edge when the page has another size; else where the user put it."""
        if (page.x, page.y) != self._page:
            self._page = (page.x, page.y)
            always = int(gui.Cond.Always)
            gui.SetNextWindowPos(gui.Vec2(page.x - 8, 68), always, gui.Vec2(1.0, 0.0))
            wide, tall = min(_PANEL, 0.5 * page.x), max(page.y - 110, 100)
            gui.SetNextWindowSize(gui.Vec2(wide, tall), always)

    def _build_faster(self, present: int) -> None:
        for times in FASTER:
            if gui.RadioButton(f"{times}x", times == present):
                self.viewer.send_to_sim(FasterSnapshot(times))
            gui.SameLine()
        gui.TextUnformatted("real time")

    def _build_counts(self, moment: Moment) -> None:
        style = gui.TableFlags
        flags = int(style.RowBg) | int(style.BordersInnerV) | int(style.SizingFixedFit)
        own = {f"{name}: {category}" for name, category in words.person(moment.codes, self._scheme)}
        names = self._scheme.issue_names
        if gui.BeginTable("counts", 2 + len(names), flags):
            for heading in ("group", "n", *names):
                gui.TableSetupColumn(heading)
            gui.TableHeadersRow()
            for name, services, found in words.counts(moment.tally, self._scheme):
                gui.TableNextRow()
                for text in (name, services, *found):
                    gui.TableNextColumn()
                    gui.TextUnformatted(f"> {text}" if text in own else text)
            gui.EndTable()


def _table(name: str, rows: list[tuple[str, str]]) -> None:
    if gui.BeginTable(name, 2):
        for left, right in rows:
            gui.TableNextRow()
            gui.TableNextColumn()
            gui.TextWrapped(left)
            gui.TableNextColumn()
            gui.TextWrapped(right)
        gui.EndTable()
