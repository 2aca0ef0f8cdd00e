"use strict";
// Shows /lead/numbers, every ten seconds anew. Everything is set as text, never as HTML.

const STATES = ["began", "finished", "under_way", "dropped_out", "withdrawn"];
const WORDS = {
  began: "began",
  finished: "finished",
  under_way: "under way",
  dropped_out: "dropped out",
  withdrawn: "withdrawn",
};
const KINDS = ["real", "simulated", "preview"];
const said = document.getElementById("said");
const button = document.getElementById("close");
let closed = false;

function table(section, caption, heads, rows) {
  const wide = document.createElement("div");
  wide.className = "wide";
  wide.tabIndex = 0;
  wide.setAttribute("role", "region");
  wide.setAttribute("aria-label", `${section.firstElementChild.textContent}: ${caption}`);
  const made = wide.appendChild(document.createElement("table"));
  made.createCaption().textContent = caption;
  const head = made.createTHead().insertRow();
  for (const word of heads) {
    const cell = head.appendChild(document.createElement("th"));
    cell.scope = "col";
    cell.textContent = word;
  }
  const body = made.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    row.forEach((value, place) => {
      const cell = line.appendChild(document.createElement(place ? "td" : "th"));
      if (!place) cell.scope = "row";
      cell.textContent = value === null ? "not known yet" : String(value);
    });
  }
  return wide;
}

function show(section, told) {
  section.hidden = told.counts.began === 0 && section.id !== "real";
  while (section.children.length > 1) section.lastChild.remove();
  const heads = STATES.map((state) => WORDS[state]);
  const counts = (of) => STATES.map((state) => of[state]);
  section.append(
    table(section, "By order of the sets", ["order", ...heads], [
      ["all", ...counts(told.counts)],
      ...told.orders.map((one) => [one.order, ...counts(one)]),
    ]),
    table(section, "Time", ["span", "median, minutes", "of n who finished"], [
      ["from beginning to end", told.minutes.median, told.minutes.n],
    ]),
  );
  if (told.checks.length) {
    section.append(table(section, "Attention checks", ["check", "answered", "failed"],
      told.checks.map((one) => [one.check, one.answered, one.failed])));
  }
  section.append(table(section, "Agreement over the sets", ["question", "Krippendorff's alpha", "answers"],
    told.agreement.map((one) => [one.question, one.alpha, one.answers])));
}

async function load() {
  try {
    const answer = await fetch("/lead/numbers");
    if (answer.status === 401) {
      location.assign("/lead");
      return;
    }
    if (!answer.ok) throw new Error(String(answer.status));
    const numbers = await answer.json();
    closed = numbers.closed;
    said.textContent = `As of ${numbers.at}. The study is ${closed ? "closed" : "open"}. ` +
      "Who was not seen for an hour counts as dropped out.";
    button.hidden = false;
    button.textContent = closed ? "Open the study again" : "Close the study: take no more answers";
    for (const kind of KINDS) show(document.getElementById(kind), numbers[kind]);
  } catch {
    said.textContent = "The numbers cannot be loaded just now; trying again.";
  }
}

button.addEventListener("click", async () => {
  if (!closed && !confirm("Close the study? Who is under way cannot go on.")) return;
  const done = await fetch("/lead/closed", {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ closed: !closed }),
  }).then((answer) => answer.ok, () => false);
  await load();
  if (!done) said.textContent = `The study could not be ${closed ? "opened" : "closed"}: try again.`;
});

load();
setInterval(load, 10000);
