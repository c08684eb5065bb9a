// Starts the page: what there is, then the map, then the version it opens with.
'use strict';

(() => {
  const { state, byId, el } = tilefold;
  let fading = 0;

  function toast(words, isError = false) {
    const note = byId('toast');
    note.textContent = words;
    note.classList.toggle('error', isError);
    note.hidden = false;
    clearTimeout(fading);
    fading = setTimeout(() => { note.hidden = true; }, isError ? 8000 : 1600);
  }

  Object.assign(tilefold, { toast, complain: (error) => toast(error.message, true) });

  async function start() {
    if (!globalThis.maplibregl) throw new Error('The map library is missing: run `cargo xtask setup`, then build the program again.');
    state.index = await tilefold.load('index');
    const { title, version } = state.index;
    byId('title').textContent = title;
    document.title = `${title} · Tilefold review`;
    await tilefold.readDecisions();
    tilefold.startControls();
    await tilefold.startMap();
    await state.showVersion(version);
    document.documentElement.dataset.ready = 'yes';
  }

  start().catch((error) => {
    byId('map').replaceChildren(el('p', { class: 'error broken' }, error.message));
    document.documentElement.dataset.ready = 'no';
  });
})();
