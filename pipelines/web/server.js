// SPDX-License-Identifier: LGPL-2.1-or-later
// The server that this page came from, and the token for it.

// @return { url, title } if a rangewebsink served this page; null if any other server did
export const findServer = async () => {
  try {
    const answer = await fetch ('server.json', { cache: 'no-store' });
    const { version, title } = answer.ok ? await answer.json () : {};
    return Number.isInteger (version) ? { url: new URL ('stream', location).href.replace (/^http/, 'ws').replace (/[?#].*/, ''), title } : null;
  } catch {
    return null;
  }
};

// Each server has its own.
const place = (url) => `rangecast-token ${url}`;
export const storeToken = (url, token) => sessionStorage.setItem (place (url), token);

// The token of the address's fragment. It is removed from there, so that it is not shown and not passed on with a copied link, and
// kept for when this tab loads the page anew. url: of the server. @return undefined if there is none
export const readToken = (url) => {
  const token = new URLSearchParams (location.hash.slice (1)).get ('token');
  if (token !== null) {
    history.replaceState (null, '', location.pathname + location.search);
    storeToken (url, token);
  }
  return token ?? sessionStorage.getItem (place (url)) ?? undefined;
};
