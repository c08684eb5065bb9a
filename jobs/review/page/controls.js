// The version slider, the filters, the theme and the keys.
'use strict';

(() => {
  const { state, el, byId, verdictName, kindName, many } = tilefold;
  const VERDICTS = ['added', 'removed', 'modified', 'unknown', 'stale'];
  const KINDS = ['lane_marking', 'stop_line', 'crosswalk', 'ground_sign'];
  const REVIEWS = [['open', 'Not yet'], ['accept', 'Accepted'], ['reject', 'Rejected'], ['later', 'Later']];

  function versions() {
    const slider = byId('version');
    const { versions, version } = state.index;
    slider.max = String(versions.length - 1);
    slider.value = String(versions.findIndex((shown) => shown.version === version));
    slider.disabled = versions.length < 2;
    byId('time').classList.toggle('single', versions.length < 2);
    let turn = 0;
    slider.addEventListener('input', () => {
      sayVersion();
      turn += 1;
      const mine = turn;
      // A drag passes many versions by: only where it rests is one loaded.
      setTimeout(() => mine === turn && state.showVersion(chosenVersion().version).catch(tilefold.complain), 120);
    });
    sayVersion();
  }

  const chosenVersion = () => state.index.versions[Number(byId('version').value)];

  function sayVersion() {
    const shown = chosenVersion();
    const words = `${shown.version} · ${tilefold.day(shown.timestamp_ms / 1000)} · ${shown.operation}`;
    byId('version-said').textContent = words;
    byId('version').setAttribute('aria-valuetext', words);
  }

  function chips(id, set, choices) {
    const chip = ([name, label, swatch]) => el('button', {
      type: 'button', class: 'chip', 'data-name': name, onclick: () => {
        const of = state.filters[set];
        if (!of.delete(name)) of.add(name);
        changed();
      },
    }, swatch ? el('i', { class: `swatch ${name}` }) : null, label, el('span', { class: 'quiet number' }));
    byId(id).replaceChildren(...choices.map(chip));
  }

  function filters() {
    chips('verdicts', 'verdicts', VERDICTS.map((name) => [name, verdictName(name), true]));
    chips('kinds', 'kinds', KINDS.map((name) => [name, kindName(name)]));
    chips('reviews', 'reviews', REVIEWS);
    byId('posterior').addEventListener('input', (event) => { state.filters.posterior = Number(event.target.value) * 10; changed(); });
    byId('vehicles').addEventListener('input', (event) => { state.filters.vehicles = Number(event.target.value); changed(); });
    byId('order').addEventListener('change', (event) => { state.filters.order = event.target.value; changed(); });
    byId('search').addEventListener('input', (event) => { state.filters.text = event.target.value.trim().toLowerCase(); changed(); });
    byId('search').addEventListener('keydown', (event) => {
      if (event.key !== 'Enter') return;
      state.filter();
      if (state.shown.length) state.choose(state.shown[0]);
    });
    byId('filter-reset').addEventListener('click', () => { state.filters = { ...state.defaults(), order: state.filters.order }; byId('search').value = ''; changed(); });
    byId('filters').open = matchMedia('(min-width: 861px) and (min-height: 1000px)').matches;
    show();
  }

  // One pass over the layer a frame, however fast a slider moves.
  let isWaiting = false;
  function changed() {
    show();
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => { isWaiting = false; state.filter(); });
  }

  function show() {
    const { filters } = state;
    for (const set of ['verdicts', 'kinds', 'reviews']) {
      for (const chip of byId(set).children) chip.setAttribute('aria-pressed', String(filters[set].has(chip.dataset.name)));
    }
    byId('posterior').value = String(filters.posterior / 10);
    byId('posterior-said').textContent = filters.posterior ? `${filters.posterior / 10} %` : 'any';
    byId('vehicles').value = String(filters.vehicles);
    byId('vehicles-said').textContent = filters.vehicles ? String(filters.vehicles) : 'any';
    const usual = state.defaults();
    const differ = ['posterior', 'vehicles', 'text'].filter((name) => filters[name] !== usual[name]).length
      + ['verdicts', 'kinds', 'reviews'].filter((name) => [...usual[name]].sort().join() !== [...filters[name]].sort().join()).length;
    byId('filter-said').textContent = differ ? `${many(differ, 'filter')} set` : '';
    byId('filter-reset').hidden = !differ;
  }

  // How many there are of each, whatever is filtered.
  function counts() {
    const { layer } = state;
    for (const chip of byId('verdicts').children) {
      const count = layer.counts[state.index.names.verdicts.indexOf(chip.dataset.name)] ?? 0;
      chip.lastElementChild.textContent = count.toLocaleString('en');
    }
    const ofKind = new Array(state.index.names.kinds.length).fill(0);
    for (const kind of layer.kind) ofKind[kind] += 1;
    for (const chip of byId('kinds').children) {
      chip.lastElementChild.textContent = ofKind[state.index.names.kinds.indexOf(chip.dataset.name)].toLocaleString('en');
    }
  }

  function theme() {
    const root = document.documentElement;
    try {
      const kept = localStorage.getItem('tilefold theme');
      if (kept === 'light' || kept === 'dark') root.dataset.theme = kept;
    } catch { /* The system's is as good. */ }
    byId('theme').addEventListener('click', () => {
      root.dataset.theme = tilefold.isDark() ? 'light' : 'dark';
      try {
        localStorage.setItem('tilefold theme', root.dataset.theme);
      } catch { /* It holds until the page is closed. */ }
      tilefold.recolour();
    });
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => tilefold.recolour());
  }

  const KEYS = [
    ['j', 'next change', () => state.step(1)],
    ['k', 'previous change', () => state.step(-1)],
    ['a', 'accept, and on to the next', () => tilefold.decide('accept')],
    ['r', 'reject, and on to the next', () => tilefold.decide('reject')],
    ['l', 'later, and on to the next', () => tilefold.decide('later')],
    ['n', 'write a note', () => byId('note')?.focus()],
    ['/', 'find an element or a change', () => byId('search').focus()],
    ['f', 'filters', () => { byId('filters').open = !byId('filters').open; }],
    ['c', 'coverage: where nobody looked', () => tilefold.toggleLayer('coverage')],
    ['m', 'the map below', () => tilefold.toggleLayer('map')],
    ['g', 'regions', () => tilefold.toggleLayer('regions')],
    ['?', 'these keys', () => byId('help').showModal()],
  ];

  function keys() {
    const rows = [...KEYS, ['Esc', 'close, or leave a field']].map(([key, words]) => el('tr', {}, el('td', {}, el('kbd', {}, key)), el('td', {}, words)));
    byId('help').replaceChildren(el('h2', {}, 'Keys'), el('table', {}, el('tbody', {}, ...rows)), el('form', { method: 'dialog' }, el('button', { class: 'say' }, 'Close')));
    byId('help-open').addEventListener('click', () => byId('help').showModal());
    addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || byId('help').open) return;
      const isField = event.target.matches?.('input:not([type=range]), textarea, select');
      if (event.key === 'Escape') {
        if (isField) event.target.blur();
        else state.choose(-1);
        return;
      }
      if (isField) return;
      const arrow = event.target.id === 'list' && { ArrowDown: 'j', ArrowUp: 'k' }[event.key];
      const found = KEYS.find(([key]) => key === (arrow || event.key));
      if (!found) return;
      event.preventDefault();
      found[2]();
    });
  }

  state.on('layer', counts);
  Object.assign(tilefold, { startControls: () => { versions(); filters(); theme(); keys(); } });
})();
