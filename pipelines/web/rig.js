// SPDX-License-Identifier: LGPL-2.1-or-later
// The dashboard: the rig with each camera's state, and what all elements of all hosts report (docs/guide/statistics.md).
import { Connection } from './connection.js';
import { Core, DONE } from './core.js';
import { RigPicture } from './rig-picture.js';
import { findServer, storeToken, readToken } from './server.js';

const INTERVAL = 500; // ms between two pictures of this page
const WINDOW = 5000; // ms over which rates are counted
const LATE = 500, GONE = 2000; // ms without a view
const STALE = 3, EXPIRY = 60; // seconds without a report
const MAX_WARNINGS = 20;

const element = (id) => document.getElementById (id);
const text = (value, digits = 0) => Number.isFinite (value) ? value.toFixed (digits).replace (/^-(?=[0.]*$)/, '') : ''; // no -0
const milliseconds = (ns) => text (ns / 1e6, 1);

const say = (sentence, kind = 'error') => {
  const place = element ('message');
  place.textContent = sentence;
  place.className = kind;
  place.hidden = sentence === '';
  document.body.dataset.message = sentence;
};

element ('message').onclick = () => say ('');

// Fills a table's body: rows of { cells, kind }, kind being '', 'late' or 'gone'.
const fill = (table, rows) => {
  table.tBodies[0].replaceChildren (...rows.map (({ cells, kind }) => {
    const row = document.createElement ('tr');
    row.className = kind;
    for (const cell of cells)
      row.insertCell ().textContent = cell;
    return row;
  }));
};

// When frame sets came, and each view in them.
class ViewTimes {
  constructor () {
    this.times = new Map (); // by view-id: ms
    this.sets = [];
    this.missing = new Map ();
  }
  add (now, captured, ids, present) {
    this.sets.push (now);
    for (const id of ids) {
      const view = this.times.get (id) ?? { arrivals: [], captured: 0 };
      this.times.set (id, view);
      if (present.has (id)) {
        view.arrivals.push (now);
        view.captured = captured;
      } else
        this.missing.set (id, (this.missing.get (id) ?? 0) + 1);
    }
    this.expire (now);
  }
  expire (now) {
    for (const list of [this.sets, ...[...this.times.values ()].map ((view) => view.arrivals)])
      while (list.length > 0 && list[0] < now - WINDOW)
        list.shift ();
  }
  // A second. It falls when nothing has arrived for twice the mean interval.
  rate (list, now) {
    if (list.length < 2)
      return 0;
    const intervals = list.length - 1, span = list.at (-1) - list[0];
    return 1000 * intervals / (now - list.at (-1) > 2 * span / intervals ? now - list[0] : span);
  }
}

class Dashboard {
  constructor (module, url, token) {
    this.module = module;
    this.url = url;
    this.picture = new RigPicture (element ('rig'));
    this.rows = new Map (); // the last report by host, element and pad
    this.warnings = [];
    element ('token').onsubmit = (event) => {
      event.preventDefault ();
      storeToken (this.url, element ('token-text').value);
      this.connect (element ('token-text').value);
    };
    this.connect (token);
    setInterval (() => this.show (), INTERVAL);
  }

  connect (token) {
    element ('token').hidden = true;
    this.core = new Core (this.module);
    this.reset ();
    this.connection = new Connection ({ url: this.url, token, want: ['stream', 'stats'], on: {
      frameSet: (frameSet) => this.decode (frameSet), say, stats: (rows) => this.recordReports (rows),
      state: (name) => {
        document.body.dataset.state = name;
        element ('token').hidden = name !== 'token';
        if (name === 'connecting')
          this.reset ();
      },
    } });
  }
  reset () {
    this.core.call ('rc_forget_stream');
    this.generation = 0;
    this.times = new ViewTimes ();
    this.bytes = 0;
    this.network = null;
  }

  decode (frameSet) {
    const { core } = this;
    try {
      if (frameSet.discontinuity)
        core.call ('rc_forget_references');
      for (const units of frameSet.units)
        core.addUnits (units);
      const outcome = core.decode ();
      this.connection.acknowledge (frameSet);
      if (outcome !== DONE)
        return;
    } catch (error) {
      say (error.message);
      return this.connection.reopen ();
    }
    if (core.call ('rc_rig_generation') !== this.generation) {
      this.generation = core.call ('rc_rig_generation');
      this.rig = core.rig ();
      this.times = new ViewTimes ();
      this.picture.views = this.rig.map ((view) => ({ ...view, state: 'gone', label: '' }));
    }
    const now = performance.timeOrigin + performance.now ();
    this.decoded = core.views ();
    for (const view of this.decoded) { // planes are the module's memory
      const pixels = view.depth;
      view.points = pixels.reduce ((sum, depth) => sum + (depth > 0), 0);
    }
    this.times.add (now, frameSet.captured, this.rig.map ((view) => view.id), new Set (this.decoded.map ((view) => view.id)));
    this.network = frameSet;
    this.picture.samplePoints (this.decoded);
    document.body.dataset.frameSets = Number (document.body.dataset.frameSets ?? 0) + 1;
  }

  recordReports (rows) {
    const now = performance.now () / 1000;
    for (const row of rows) {
      if (typeof row?.host !== 'string' || typeof row.name !== 'string')
        continue;
      if (typeof row.warning === 'string')
        this.recordWarning (row);
      else {
        const key = `${row.host} ${row.name} ${row.pad ?? ''}`, before = this.rows.get (key);
        this.rows.set (key, { ...row, seen: now - (Number (row.age) || 0), loses: row.lost > (before?.lost ?? Infinity) });
      }
    }
  }
  recordWarning ({ host, name, warning, time }) {
    if (this.warnings.some ((one) => one.time === time && one.warning === warning && one.host === host))
      return;
    this.warnings = [{ host, name, warning, time }, ...this.warnings].slice (0, MAX_WARNINGS);
  }

  // ---- what is shown ----

  show () {
    const now = performance.timeOrigin + performance.now ();
    this.times.expire (now);
    fill (element ('views'), this.picture.views.map ((view) => this.viewRow (view, now)));
    this.picture.draw ();
    const { network } = this;
    element ('summary').textContent = network ? `${this.picture.views.length} views, ${text (this.times.rate (this.times.sets, now), 1)} frame sets/s; `
      + `${network.dropped} dropped for this page; latency ${text (this.latency (now))} ms` : '';
    fill (element ('elements'), this.elementRows ());
    element ('warnings').replaceChildren (...this.warnings.map (({ host, name, warning, time }) => {
      const item = document.createElement ('li');
      item.textContent = `${Number.isFinite (time) ? new Date (1000 * time).toLocaleTimeString () + ' ' : ''}${host ?? ''} ${name ?? ''}: ${warning}`;
      return item;
    }));
  }
  latency (now) {
    const { sets } = this.times;
    return sets.length > 0 ? sets.at (-1) - this.network.captured : NaN;
  }

  viewRow (view, now) {
    const times = this.times.times.get (view.id), last = times?.arrivals.at (-1) ?? -Infinity;
    const age = now - (times?.captured || -Infinity);
    view.state = now - last > GONE ? 'gone' : now - last > LATE ? 'late' : 'good';
    const decoded = view.state !== 'gone' && this.decoded?.find ((one) => one.id === view.id);
    view.label = `${view.width}x${view.height}, ${view.state === 'gone' ? 'no picture' : `${text (age)} ms`}`;
    return { kind: view.state === 'good' ? '' : view.state, cells: [view.id, view.name, `${view.width}x${view.height}`,
      decoded ? `${decoded.width}x${decoded.height}` : '', decoded ? decoded.points : '', text (this.times.rate (times?.arrivals ?? [], now), 1),
      this.times.missing.get (view.id) ?? 0, text (age)] };
  }

  elementRows () {
    const now = performance.now () / 1000;
    for (const [key, row] of this.rows)
      if (now - row.seen > EXPIRY)
        this.rows.delete (key);
    const rows = [...this.rows.values ()].sort ((a, b) => `${a.host} ${a.name} ${a.pad ?? ''}`.localeCompare (`${b.host} ${b.name} ${b.pad ?? ''}`));
    return rows.map ((row) => {
      const stale = now - row.seen > STALE, current = (value) => stale ? '' : value;
      return { kind: stale ? 'gone' : row.fps === 0 || row.loses ? 'late' : '',
        cells: [row.host, row.pad ? `${row.name}.${row.pad}` : row.name, row['view-ids']?.join?.(' ') ?? '', current (text (row.fps, 1)),
          current (text (row['points-per-frame'])), current (text (row.bitrate / 1e6, 2)), row.lost ?? '', row.late ?? '',
          current (milliseconds (row['latency-p50'])), current (milliseconds (row['latency-p99'])), text (1000 * row.clock), text (now - row.seen)] };
    });
  }
}

try {
  const server = await findServer ();
  if (!server)
    throw new Error ('This page works only when rangewebsink serves it.');
  const module = await WebAssembly.compile (await (await fetch ('rangecast.wasm')).arrayBuffer ());
  window.rangecastDashboard = new Dashboard (module, server.url, readToken (server.url));
} catch (error) {
  say (error.message);
}
