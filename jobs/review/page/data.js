// How the page gets its documents: from the server that it came from, or, where it was opened from
// a file, from scripts beside it that hand over their value (a browser lets such a page read no file).
'use strict';

globalThis.tilefold = (() => {
  const isServed = document.documentElement.dataset.mode === 'served';
  const given = new Map();

  function give(key, value) {
    given.set(key, value);
  }

  function fromScript(key) {
    return new Promise((resolve, reject) => {
      const script = document.createElement('script');
      script.src = `data/${key}.js`;
      script.onload = () => {
        script.remove();
        const value = given.get(key);
        given.delete(key);
        resolve(value);
      };
      script.onerror = () => {
        script.remove();
        reject(new Error(`${script.src} is missing`));
      };
      document.head.append(script);
    });
  }

  async function fetched(key) {
    const response = await fetch(`data/${key}`);
    if (!response.ok) throw new Error((await response.text()) || `${key}: ${response.status}`);
    return response;
  }

  async function load(key) {
    return isServed ? (await fetched(key)).json() : fromScript(key);
  }

  // Why a change is claimed; null where this page does not have that.
  async function explanation(version, change, tile) {
    if (isServed) {
      const response = await fetch(`data/explain/${version}/${change}`);
      if (response.status === 404) return null;
      if (!response.ok) throw new Error(await response.text());
      return response.json();
    }
    try {
      return (await fromScript(`explain/${version}/${tile}`))[change] ?? null;
    } catch {
      return null;
    }
  }

  // Where the picture of a frame is, for as long as the page is open.
  async function picture(version, change, place) {
    return URL.createObjectURL(await (await fetched(`frame/${version}/${change}/${place}`)).blob());
  }

  // Bytes of a tile of the map; none where nothing lies.
  async function mapTile(key) {
    if (isServed) return (await fetched(key)).arrayBuffer();
    try {
      const text = atob(await fromScript(key));
      return Uint8Array.from(text, (letter) => letter.charCodeAt(0)).buffer;
    } catch {
      return new ArrayBuffer(0);
    }
  }

  // Where the worker of the map library is. A page from a file may start none from a file.
  function workerUrl() {
    if (isServed) return 'maplibre/worker.js';
    const text = given.get('worker');
    return URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  }

  async function post(key, value) {
    const response = await fetch(`data/${key}`, {
      method: 'POST',
      headers: { 'Content-Type': 'application/json' },
      body: JSON.stringify(value),
    });
    if (!response.ok) throw new Error(await response.text());
    return response.json();
  }

  return { isServed, give, load, explanation, picture, mapTile, workerUrl, post };
})();
