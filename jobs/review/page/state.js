// What the page knows: the version's layer, the filters, what is chosen, what was decided.
// Others listen for what changed: `layer`, `filter`, `chosen`, `decisions`.
'use strict';

tilefold.state = (() => {
  const events = new EventTarget();
  const state = {
    index: null,
    layer: null,
    decisions: new Map(),
    chosen: -1,
    // Positions in the layer that pass the filters, in the order of the list.
    shown: [],
    filters: null,
  };
  const layers = new Map();

  const defaults = () => ({
    verdicts: new Set(['added', 'removed', 'modified']),
    kinds: new Set(['lane_marking', 'stop_line', 'crosswalk', 'ground_sign']),
    reviews: new Set(['open', 'accept', 'reject', 'later']),
    posterior: 500,
    vehicles: 0,
    text: '',
    order: 'sure',
  });
  state.filters = defaults();

  const on = (name, listener) => events.addEventListener(name, listener);
  const tell = (name) => events.dispatchEvent(new Event(name));

  // A geometry from its steps: `[is_area, longitude, latitude, ...]` in 1e-8 degrees.
  function geometry(steps) {
    if (!steps) return null;
    const points = [];
    let [x, y] = [0, 0];
    for (let at = 1; at + 1 < steps.length; at += 2) {
      x += steps[at];
      y += steps[at + 1];
      points.push([x / 1e8, y / 1e8]);
    }
    if (!steps[0]) return { type: 'LineString', coordinates: points };
    points.push(points[0]);
    return { type: 'Polygon', coordinates: [points] };
  }

  // What is added or modified is where it is on the road; all else is where the map has it.
  function shownGeometry(layer, at) {
    const verdict = verdictOf(layer, at);
    const isOnRoad = verdict === 'added' || verdict === 'modified';
    const [first, second] = isOnRoad ? [layer.new, layer.old] : [layer.old, layer.new];
    return geometry(first[at] ?? second[at]);
  }

  const verdictOf = (layer, at) => state.index.names.verdicts[layer.verdict[at]];
  const kindOf = (layer, at) => state.index.names.kinds[layer.kind[at]];
  const isClaim = (verdict) => verdict === 'added' || verdict === 'removed' || verdict === 'modified';

  // Posterior of what is said, in thousandths; of a change at all where nothing is claimed.
  function posteriorOf(layer, at) {
    const all = layer.posterior[at];
    const of = { added: all[1], removed: all[2], modified: all[3] };
    return of[verdictOf(layer, at)] ?? 1000 - all[0];
  }

  function className(layer, at, codes) {
    const code = codes[at];
    const kind = kindOf(layer, at);
    const names = { lane_marking: state.index.names.markings, ground_sign: state.index.names.signs }[kind];
    const name = code === null || !names ? undefined : names[code];
    return name === 'unknown' ? undefined : name;
  }

  const reviewOf = (layer, at) => state.decisions.get(layer.change[at])?.decision ?? 'open';

  function passes(layer, at) {
    const { verdicts, kinds, reviews, posterior, vehicles } = state.filters;
    const verdict = verdictOf(layer, at);
    return verdicts.has(verdict) && kinds.has(kindOf(layer, at))
      && layer.vehicles[at] >= (isClaim(verdict) ? vehicles : 0)
      && (!isClaim(verdict) || posteriorOf(layer, at) >= posterior)
      && reviews.has(reviewOf(layer, at));
  }

  function found(layer, at) {
    const text = state.filters.text;
    return !text || layer.change[at].startsWith(text) || String(layer.element[at] ?? '').startsWith(text);
  }

  const ORDERS = {
    sure: (layer) => (a, b) => posteriorOf(layer, b) - posteriorOf(layer, a) || layer.vehicles[b] - layer.vehicles[a] || a - b,
    doubt: (layer) => (a, b) => posteriorOf(layer, a) - posteriorOf(layer, b) || a - b,
    recent: (layer) => (a, b) => layer.last_s[b] - layer.last_s[a] || a - b,
    place: (layer) => (a, b) => (layer.region[a] ?? 1e9) - (layer.region[b] ?? 1e9) || a - b,
  };

  function filter() {
    const { layer, filters } = state;
    const shown = [];
    // An id that is asked for is found whatever else is filtered.
    const test = filters.text ? found : passes;
    for (let at = 0; at < layer.change.length; at += 1) {
      if (test(layer, at)) shown.push(at);
    }
    state.shown = shown.sort(ORDERS[filters.order](layer));
    tell('filter');
  }

  async function showVersion(version) {
    if (!layers.has(version)) {
      layers.set(version, await tilefold.load(`versions/${version}`));
      // A long history is not kept whole.
      if (layers.size > 6) layers.delete(layers.keys().next().value);
    }
    const chosen = state.layer && state.chosen >= 0 ? state.layer.change[state.chosen] : null;
    state.layer = layers.get(version);
    state.chosen = chosen === null ? -1 : state.layer.change.indexOf(chosen);
    tell('layer');
    filter();
    tell('chosen');
  }

  function choose(at) {
    if (at === state.chosen) return;
    state.chosen = at;
    tell('chosen');
  }

  // The next one in the list (`step` 1) or the one before (-1); `isWanted` may pass some over.
  function step(step, isWanted = () => true) {
    const here = state.shown.indexOf(state.chosen);
    for (let place = here < 0 && step < 0 ? state.shown.length - 1 : here + step;
      place >= 0 && place < state.shown.length; place += step) {
      if (isWanted(state.shown[place])) return choose(state.shown[place]);
    }
    return undefined;
  }

  function keepDecision(decision) {
    if (decision.decision === 'undo') state.decisions.delete(decision.change);
    else state.decisions.set(decision.change, decision);
  }

  return Object.assign(state, {
    on, tell, defaults, geometry, shownGeometry, verdictOf, kindOf, isClaim, posteriorOf, className,
    reviewOf, filter, showVersion, choose, step, keepDecision,
  });
})();
