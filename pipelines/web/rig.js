// SPDX-License-Identifier: LGPL-2.1-or-later
// The dashboard: what all elements of all hosts report (docs/guide/statistics.md), and their warnings.
import { Connection } from './connection.js';
import { findServer, storeToken, readToken } from './server.js';

const INTERVAL = 500; // ms between two pictures of this page
const STALE = 3, EXPIRY = 60; // seconds without a report
const MAX_WARNINGS = 20, MAX_ROWS = 1000;

const element = (id) => document.getElementById (id);
const text = (value, digits = 0) => Number.isFinite (value) ? value.toFixed (digits).replace (/^-(?=[0.]*$)/, '') : ''; // no -0
const milliseconds = (ns) => text (ns / 1e6, 1);
const keyOf = ({ host, name, pad }) => `${host} ${name} ${pad ?? ''}`;

const say = (sentence, kind = 'error') => {
  const place = element ('message');
  place.textContent = sentence;
  place.className = kind;
  place.hidden = sentence === '';
  document.body.dataset.message = sentence;
};

element ('message').onclick = () => say ('');

class Dashboard {
  constructor (url, token) {
    this.url = url;
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
    this.connection = new Connection ({ url: this.url, token, want: ['stats'], on: {
      say, stats: (reports) => reports.forEach ((one) => this.record (one)),
      state: (name) => {
        document.body.dataset.state = name;
        element ('token').hidden = name !== 'token';
      },
    } });
  }

  // received: ms since the epoch, by the server's clock; report: what anybody may have sent to the server's port, as text
  record ({ received, report }) {
    let row;
    try {
      row = JSON.parse (report);
    } catch {
      return;
    }
    if (typeof row?.host !== 'string' || typeof row.name !== 'string')
      return;
    if (typeof row.warning === 'string')
      this.warnings = [row, ...this.warnings].slice (0, MAX_WARNINGS);
    else if (this.rows.size < MAX_ROWS || this.rows.has (keyOf (row)))
      this.rows.set (keyOf (row), { ...row, seen: performance.now () / 1000, clock: received / 1000 - row.time,
        loses: row.lost > (this.rows.get (keyOf (row))?.lost ?? Infinity) });
  }

  show () {
    const now = performance.now () / 1000;
    for (const [key, row] of this.rows)
      if (now - row.seen > EXPIRY)
        this.rows.delete (key);
    const sorted = [...this.rows.values ()].sort ((a, b) => keyOf (a).localeCompare (keyOf (b)));
    element ('elements').tBodies[0].replaceChildren (...sorted.map ((row) => this.makeRow (row, now)));
    element ('warnings').replaceChildren (...this.warnings.map (({ host, name, warning, time }) => {
      const item = document.createElement ('li');
      item.textContent = `${Number.isFinite (time) ? new Date (1000 * time).toLocaleTimeString () + ' ' : ''}${host} ${name}: ${warning}`;
      return item;
    }));
  }

  makeRow (row, now) {
    const stale = now - row.seen > STALE, current = (value) => stale ? '' : value, line = document.createElement ('tr');
    line.className = stale ? 'gone' : row.fps === 0 || row.loses ? 'late' : '';
    for (const cell of [row.host, row.pad ? `${row.name}.${row.pad}` : row.name, row['view-ids']?.join?.(' ') ?? '', current (text (row.fps, 1)),
      current (text (row['points-per-frame'])), current (text (row.bitrate / 1e6, 2)), row.lost ?? '', row.late ?? '',
      current (milliseconds (row['latency-p50'])), current (milliseconds (row['latency-p99'])), text (1000 * row.clock), text (now - row.seen)])
      line.insertCell ().textContent = cell;
    return line;
  }
}

try {
  const server = await findServer ();
  if (!server)
    throw new Error ('This page works only when rangewebsink serves it.');
  window.rangecastDashboard = new Dashboard (server.url, readToken (server.url));
} catch (error) {
  say (error.message);
}
