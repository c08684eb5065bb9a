// The list of changes: as long as the layer, but only the rows in sight are elements.
'use strict';

(() => {
  const { state, el, byId, verdictName, kindName, saidName, percent, many } = tilefold;
  const ROW = 54;
  const list = byId('list');
  const space = byId('list-space');
  let drawn = '';

  function row(place) {
    const at = state.shown[place];
    const { layer } = state;
    const verdict = state.verdictOf(layer, at);
    const said = state.decisions.get(layer.change[at])?.decision;
    const element = layer.element[at];
    const what = element === null ? 'not in the map' : `element ${element}`;
    return el('div', {
      class: 'item', role: 'option', id: `item-${at}`, 'aria-selected': String(at === state.chosen), 'data-at': at,
    },
    el('i', { class: `swatch ${verdict}` }),
    el('span', { class: 'what' }, `${kindName(state.kindOf(layer, at))} ${verdictName(verdict).toLowerCase()}`),
    el('span', { class: 'number' }, state.isClaim(verdict) ? percent(state.posteriorOf(layer, at)) : ''),
    el('span', { class: 'where quiet' }, `${what} · ${many(layer.vehicles[at], 'vehicle')}`),
    said ? el('span', { class: `said ${said}` }, saidName(said)) : el('span'));
  }

  function draw() {
    const first = Math.max(0, Math.floor(list.scrollTop / ROW) - 4);
    const last = Math.min(state.shown.length, Math.ceil((list.scrollTop + list.clientHeight) / ROW) + 4);
    const key = `${first} ${last} ${list.dataset.turn}`;
    if (key === drawn) return;
    drawn = key;
    const rows = [];
    for (let place = first; place < last; place += 1) {
      const element = row(place);
      element.style.top = `${place * ROW}px`;
      rows.push(element);
    }
    space.style.height = `${state.shown.length * ROW}px`;
    space.replaceChildren(...rows);
    if (state.chosen >= 0) list.setAttribute('aria-activedescendant', `item-${state.chosen}`);
    else list.removeAttribute('aria-activedescendant');
  }

  function redraw() {
    list.dataset.turn = Number(list.dataset.turn ?? 0) + 1;
    draw();
  }

  function counts() {
    const { layer, shown } = state;
    const all = layer.change.length;
    byId('count').textContent = shown.length === all ? many(all, 'record') : `${shown.length.toLocaleString('en')} of ${many(all, 'record')}`;
    const done = shown.filter((at) => state.decisions.has(layer.change[at])).length;
    byId('progress').textContent = done ? `${done.toLocaleString('en')} reviewed` : '';
  }

  function reveal() {
    const place = state.shown.indexOf(state.chosen);
    if (place < 0) return;
    const [top, bottom] = [place * ROW, (place + 1) * ROW];
    if (top < list.scrollTop) list.scrollTop = top;
    else if (bottom > list.scrollTop + list.clientHeight) list.scrollTop = bottom - list.clientHeight;
  }

  list.addEventListener('scroll', () => requestAnimationFrame(draw));
  new ResizeObserver(redraw).observe(list);
  list.addEventListener('click', (event) => {
    const item = event.target.closest('.item');
    if (item) state.choose(Number(item.dataset.at));
  });
  state.on('filter', () => { list.scrollTop = 0; reveal(); redraw(); counts(); });
  state.on('chosen', () => { reveal(); redraw(); });
  state.on('decisions', () => { redraw(); counts(); });
})();
