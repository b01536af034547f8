"use strict";

// Entries that the program has not acknowledged yet. They are first written to the browser's
// storage, and are sent until the program confirms that they are on its disk.

const DROP_TIMEOUT = 4000;  // ms of refusals after which the user may drop an entry

class Outbox {
  constructor(plan, changed) {
    this.prefix = `burg-drake entry ${plan} `;
    this.changed = changed;   // called with the acknowledged item and the trial's entry, or nothing
    this.stored = true;       // whether the browser stores the entries
    this.problem = "";        // why the last attempt failed
    this.count = 0;
    this.items = this.load();
    this.wake = () => {};
    this.send();
  }

  load() {
    const items = [];
    try {
      for (let k = 0; k < localStorage.length; k++) {
        const key = localStorage.key(k);
        if (!key.startsWith(this.prefix)) continue;
        try { items.push({ ...JSON.parse(localStorage.getItem(key)), refused: null }); } catch { /* not ours */ }
      }
    } catch { this.stored = false; }
    return items.sort((a, b) => (a.id < b.id ? -1 : 1));
  }

  store(item) {
    try { localStorage.setItem(this.prefix + item.id, JSON.stringify(item)); }
    catch { this.stored = false; }
  }

  remove(item) {
    this.items = this.items.filter((other) => other !== item);
    try { localStorage.removeItem(this.prefix + item.id); } catch { /* it was never there */ }
  }

  // entry: fields of the request; state: of the trial that it replaces, as sent by the program.
  add(entry, state, before) {
    const earlier = this.of(entry.number).at(-1);
    const moment = String(Date.now()).padStart(14, "0");
    const random = Math.random().toString(36).slice(2, 10);
    const item = {
      id: `${moment} ${String(this.count++).padStart(6, "0")} ${random}`,
      entry: { ...entry, replaces: state },
      after: earlier ? earlier.id : "",
      before,
      trouble: null,
    };
    this.items.push(item);
    this.store(item);
    this.changed();
    this.wake();
    return item;
  }

  of(number) { return this.items.filter((item) => item.entry.number === number); }

  get troubled() { return this.items.filter((item) => item.trouble); }

  // Items that are refused repeatedly; they are still sent, as the reason may be temporary.
  get stuck() { return this.items.filter(({ refused }) => refused && refused.at - refused.since >= DROP_TIMEOUT); }

  discard(item) {
    for (const later of this.of(item.entry.number)) {
      if (later.id >= item.id) this.remove(later);
    }
    this.changed();
    this.wake();
  }

  insist(item) {
    item.entry.replaces = item.trouble.state;
    item.trouble = null;
    this.store(item);
    this.changed();
    this.wake();
  }

  nextItem() {
    const blocked = new Set(this.troubled.map((item) => item.entry.number));
    const numbers = new Set();
    const open = this.items.filter(({ entry: { number } }) => {  // the first of each trial
      if (blocked.has(number) || numbers.has(number)) return false;
      return numbers.add(number);
    });
    const at = ({ refused }) => (refused ? refused.at : 0);
    return open.sort((a, b) => at(a) - at(b))[0];  // refused items wait for the others
  }

  async send() {
    for (;;) {
      const item = this.nextItem();
      if (!item) {
        await new Promise((done) => { this.wake = done; });
        continue;
      }
      let pause = 0;
      try { pause = await this.attempt(item); }
      catch { this.problem = "burg-drake does not answer"; pause = 1000; }
      this.changed();
      if (pause) await sleep(pause);
    }
  }

  // Sends an item; returns how long to wait before the next attempt [ms].
  async attempt(item) {
    const answer = await fetch("entry", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(item.entry),
      signal: AbortSignal.timeout(40000),
    });
    const data = await answer.json();
    if (answer.ok) {
      this.problem = "";
      for (const later of this.items) {
        if (later.after !== item.id) continue;
        later.entry.replaces = data.entry.state;  // before its predecessor is forgotten
        later.after = "";
        this.store(later);
      }
      this.remove(item);
      this.changed(item, data.entry);
      return 0;
    }
    if (!this.items.includes(item)) return 0;  // it was dropped meanwhile
    if (answer.status === 409 || answer.status === 400) {
      const state = data.entry ? data.entry.state : "";
      item.trouble = { text: data.error, state, label: data.entry ? data.entry.label : "" };
      this.store(item);
      this.changed(null, data.entry);
      return 0;
    }
    this.problem = data.error;  // may be temporary, such as a file that somebody is editing
    const at = Date.now();
    item.refused = { text: data.error, since: item.refused ? item.refused.since : at, at };
    return this.nextItem().refused ? 2000 : 0;
  }
}
