// SPDX-License-Identifier: LGPL-2.1-or-later
// The page around <rangecast-view>. Parameters of the address: src=URL of a recording; server=URL of a stream (default: this page's server,
// if that has one); stats; fit=0: the first camera's view; azimuth, elevation (degrees); time (ms) and paused; transparent: nothing but the
// person; renderer=webgl or software. A token comes in the fragment (#token=...), which stays in this browser.
import { findServer, storeToken, readToken } from './server.js';
import './view.js';

const element = (id) => document.getElementById (id);
const parameters = new URLSearchParams (location.search);
const view = document.createElement ('rangecast-view');
const report = document.body.dataset;
let server = null; // address of the stream

for (const name of ['azimuth', 'elevation', 'renderer', 'transparent'])
  if (parameters.has (name))
    view.setAttribute (name, parameters.get (name));
view.toggleAttribute ('show-stats', parameters.has ('stats'));
view.toggleAttribute ('controls', !parameters.has ('transparent'));
if (parameters.get ('fit') === '0')
  view.setAttribute ('fit', 'false');
document.documentElement.classList.toggle ('transparent', parameters.has ('transparent'));

view.addEventListener ('message', ({ detail }) => { report.message = detail.text; });
view.addEventListener ('framesetchange', () => { report.frameSets = Number (report.frameSets ?? 0) + 1; });
view.addEventListener ('loadedmetadata', () => { element ('welcome').hidden = true; });
view.addEventListener ('statechange', () => {
  report.state = view.state;
  element ('token').hidden = view.state !== 'token';
  if (view.state === 'token')
    element ('token-text').focus ();
});

const openStream = (token) => view.load (server, { token });
element ('token').onsubmit = (event) => {
  event.preventDefault ();
  view.report ('');
  element ('token').hidden = true;
  storeToken (server, element ('token-text').value);
  openStream (element ('token-text').value);
};
element ('file').onchange = ({ target }) => {
  if (target.files.length > 0)
    view.load (target.files[0]);
  target.value = ''; // so that the same file can be chosen again
};
addEventListener ('keydown', (event) => event.target.matches ('input, button') || view.key (event));
addEventListener ('dragover', (event) => {
  event.preventDefault ();
  document.body.classList.add ('dropping');
});
addEventListener ('dragleave', () => document.body.classList.remove ('dropping'));
addEventListener ('drop', (event) => {
  event.preventDefault ();
  document.body.classList.remove ('dropping');
  if (event.dataTransfer.files.length > 0)
    view.load (event.dataTransfer.files[0]);
});

document.body.prepend (view);
window.rangecastView = view; // for tests and for the curious
if (parameters.has ('src'))
  view.load (new URL (parameters.get ('src'), location).href, { paused: parameters.has ('paused'), time: Number (parameters.get ('time') ?? 0) / 1000 });
else {
  const found = parameters.has ('server') ? { url: new URL (parameters.get ('server'), location).href.replace (/^http/, 'ws') } : await findServer ();
  document.title = found?.title || document.title;
  server = found?.url;
  if (server)
    openStream (readToken (server));
  else
    element ('welcome').hidden = false;
}
