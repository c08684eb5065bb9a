// The map: our own tiles below, the version's changes over them, and what is chosen on top.
'use strict';

(() => {
  const { state, el, byId } = tilefold;
  const EMPTY = { type: 'FeatureCollection', features: [] };
  // From here on changes are drawn as what they are; further out as dots.
  const NEAR = 14;

  // Okabe and Ito's colours: told apart by everybody, and by the dashes of what is gone.
  const PALETTES = {
    light: {
      ground: '#f3f4f2', paint: '#a4adb5', yellow: '#c2a34c', area: '#dfe3e4', sign: '#8d98a2',
      added: '#0072b2', removed: '#d55e00', modified: '#a33e84', unknown: '#6b7280', stale: '#8a6d1c',
      old: '#4b5563', chosen: '#111827', region: '#475569', unseen: '#b42318', thin: '#d99a26', enough: '#2e7d5b', halo: '#ffffff',
    },
    dark: {
      ground: '#14191e', paint: '#56626d', yellow: '#877437', area: '#232b32', sign: '#6c7883',
      added: '#56b4e9', removed: '#ff8a3d', modified: '#e08cc6', unknown: '#9aa5b1', stale: '#d0b25a',
      old: '#aab4be', chosen: '#ffffff', region: '#94a3b8', unseen: '#f0705f', thin: '#e6b34d', enough: '#5fbf92', halo: '#0b0f13',
    },
  };
  const isDark = () => {
    const asked = document.documentElement.dataset.theme;
    return asked ? asked === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
  };
  const palette = () => PALETTES[isDark() ? 'dark' : 'light'];

  const shownLayers = { map: true, regions: true, coverage: false };
  let map = null;
  let coverage = null;

  const code = (name) => state.index.names.verdicts.indexOf(name);
  const byVerdict = (of) => ['match', ['get', 'v'],
    code('added'), of.added, code('removed'), of.removed, code('modified'), of.modified, code('stale'), of.stale, of.unknown];
  // The surer the stronger; what was rejected fades.
  const opacity = (most = 1) => ['case', ['==', ['feature-state', 'said'], 'reject'], 0.12,
    ['interpolate', ['linear'], ['get', 'p'], 0, 0.3 * most, 500, 0.5 * most, 850, 0.9 * most, 1000, most]];
  // Outlines of areas stay thin: a sign is no larger than a few pixels for long.
  const isArea = ['==', ['geometry-type'], 'Polygon'];
  const wide = (near, far, outline = 2) => ['interpolate', ['exponential', 1.6], ['zoom'], NEAR, ['case', isArea, outline / 2, far], 19, ['case', isArea, outline, near]];

  function baseLayers(colours) {
    const map = { source: 'map', 'source-layer': 'map', layout: { visibility: shownLayers.map ? 'visible' : 'none' } };
    const isLine = ['==', ['get', 'kind'], 'lane_marking'];
    const isDashed = ['in', ['get', 'marking'], ['literal', ['dashed', 'dashed_dashed']]];
    const colour = ['match', ['get', 'color'], 'yellow', colours.yellow, colours.paint];
    const width = ['interpolate', ['exponential', 1.7], ['zoom'], 12, 0.4, 15, 0.9, 18, 2.4, 21, 9];
    return [
      { id: 'crosswalks', type: 'fill', ...map, filter: ['==', ['get', 'kind'], 'crosswalk'], paint: { 'fill-color': colours.area, 'fill-outline-color': colours.paint } },
      { id: 'signs', type: 'fill', ...map, filter: ['==', ['get', 'kind'], 'ground_sign'], minzoom: 14, paint: { 'fill-color': colours.area, 'fill-outline-color': colours.sign } },
      { id: 'stop-lines', type: 'line', ...map, filter: ['==', ['get', 'kind'], 'stop_line'], paint: { 'line-color': colours.sign, 'line-width': ['interpolate', ['exponential', 1.7], ['zoom'], 13, 1, 18, 5, 21, 16] } },
      { id: 'lines', type: 'line', ...map, filter: ['all', isLine, ['!', isDashed]], paint: { 'line-color': colour, 'line-width': width } },
      { id: 'dashed-lines', type: 'line', ...map, filter: ['all', isLine, isDashed], paint: { 'line-color': colour, 'line-width': width, 'line-dasharray': [4, 4] } },
    ];
  }

  function changeLayers(colours) {
    const changes = { source: 'changes', minzoom: NEAR };
    const colour = byVerdict(colours);
    const isRemoved = ['==', ['get', 'v'], code('removed')];
    const width = wide(7, 2.5);
    return [
      { id: 'regions', type: 'line', source: 'regions', minzoom: 13, layout: { visibility: shownLayers.regions ? 'visible' : 'none' }, paint: { 'line-color': colours.region, 'line-width': 1.2, 'line-opacity': 0.7, 'line-dasharray': [2, 2] } },
      { id: 'changes-fill', type: 'fill', ...changes, filter: isArea, paint: { 'fill-color': colour, 'fill-opacity': opacity(0.45) } },
      { id: 'changes', type: 'line', ...changes, layout: { 'line-cap': 'round', 'line-join': 'round' }, paint: { 'line-color': colour, 'line-width': width, 'line-opacity': opacity() } },
      { id: 'changes-gone', type: 'line', ...changes, layout: { 'line-join': 'round' }, metadata: { isRemoved }, paint: { 'line-color': colour, 'line-width': width, 'line-opacity': opacity(), 'line-dasharray': [1.6, 1] } },
      { id: 'dots', type: 'circle', source: 'dots', maxzoom: NEAR, paint: { 'circle-color': colour, 'circle-opacity': opacity(0.9), 'circle-radius': ['interpolate', ['linear'], ['zoom'], 8, 2, 11, 3, 14, 4.5] } },
    ];
  }

  function chosenLayers(colours) {
    const of = (role) => ({ source: 'chosen', filter: ['==', ['get', 'role'], role] });
    return [
      { id: 'chosen-band', type: 'fill', ...of('band'), paint: { 'fill-color': ['get', 'colour'], 'fill-opacity': 0.18 } },
      { id: 'chosen-fill', type: 'fill', source: 'chosen', filter: ['all', isArea, ['==', ['get', 'role'], 'new']], paint: { 'fill-color': ['get', 'colour'], 'fill-opacity': 0.4 } },
      { id: 'chosen-halo', type: 'line', source: 'chosen', filter: ['in', ['get', 'role'], ['literal', ['old', 'new']]], layout: { 'line-cap': 'round', 'line-join': 'round' }, paint: { 'line-color': colours.halo, 'line-width': wide(17, 9, 7), 'line-opacity': 0.85 } },
      { id: 'chosen-old', type: 'line', ...of('old'), layout: { 'line-join': 'round' }, paint: { 'line-color': ['get', 'colour'], 'line-width': wide(6, 3, 2.5), 'line-dasharray': [1.6, 1] } },
      { id: 'chosen-new', type: 'line', ...of('new'), layout: { 'line-cap': 'round', 'line-join': 'round' }, paint: { 'line-color': ['get', 'colour'], 'line-width': wide(9, 4.5, 3) } },
    ];
  }

  function coverageLayers(colours) {
    const layout = { visibility: shownLayers.coverage ? 'visible' : 'none' };
    return [
      { id: 'coverage', type: 'fill', source: 'coverage', layout, paint: { 'fill-color': ['match', ['get', 's'], 0, colours.unseen, 1, colours.thin, colours.enough], 'fill-opacity': ['match', ['get', 's'], 0, 0.42, 1, 0.34, 0.2] } },
      { id: 'places', type: 'circle', source: 'places', layout, paint: { 'circle-color': colours.ground, 'circle-radius': 11, 'circle-stroke-color': colours.unseen, 'circle-stroke-width': 2 } },
      { id: 'places-number', type: 'symbol', source: 'places', layout: { ...layout, 'text-field': ['to-string', ['get', 'n']], 'text-size': 12, 'text-font': ['sans-serif'], 'text-allow-overlap': true }, paint: { 'text-color': colours.chosen } },
    ];
  }

  function style() {
    const colours = palette();
    const [first, last] = state.index.zooms;
    const geojson = (options = {}) => ({ type: 'geojson', data: EMPTY, ...options });
    return {
      version: 8,
      sources: {
        map: { type: 'vector', tiles: [`tilefold://${mapKey()}/{z}/{x}/{y}`], minzoom: first, maxzoom: last, bounds: state.index.bounds },
        coverage: geojson(), regions: geojson(), changes: geojson({ maxzoom: 17, tolerance: 0.2 }), dots: geojson({ maxzoom: NEAR - 1 }), places: geojson(), chosen: geojson({ maxzoom: 20 }),
      },
      layers: [
        { id: 'ground', type: 'background', paint: { 'background-color': colours.ground } },
        ...baseLayers(colours), ...coverageLayers(colours).slice(0, 1), ...changeLayers(colours), ...chosenLayers(colours), ...coverageLayers(colours).slice(1),
      ],
    };
  }

  const mapKey = () => {
    const version = state.layer?.version ?? state.index.version;
    return state.index.versions.find((shown) => shown.version === version)?.map ?? '';
  };

  async function start() {
    maplibregl.setWorkerUrl(tilefold.workerUrl());
    maplibregl.addProtocol('tilefold', async ({ url }) => ({ data: await tilefold.mapTile(`map/${url.slice('tilefold://'.length)}`) }));
    const [west, south, east, north] = state.index.bounds;
    map = new maplibregl.Map({
      container: 'map', style: style(), bounds: [[west, south], [east, north]], fitBoundsOptions: { padding: 40 },
      minZoom: 3, maxZoom: 23, attributionControl: false, dragRotate: true, pitchWithRotate: false, keyboard: false, fadeDuration: 0,
    });
    tilefold.map = map;
    map.addControl(new maplibregl.NavigationControl({ visualizePitch: false }), 'top-right');
    map.addControl(new maplibregl.ScaleControl(), 'bottom-right');
    map.on('click', clicked);
    map.on('mousemove', (event) => {
      map.getCanvas().style.cursor = at(event.point).length ? 'pointer' : '';
    });
    await map.once('load');
    state.on('layer', drawLayer);
    state.on('filter', drawFilter);
    state.on('chosen', drawChosen);
    state.on('decisions', drawDecisions);
    drawLegend();
  }

  const at = ({ x, y }) => map.queryRenderedFeatures([[x - 6, y - 6], [x + 6, y + 6]], { layers: ['changes', 'changes-gone', 'changes-fill', 'dots'] });

  function clicked(event) {
    const place = shownLayers.coverage && map.queryRenderedFeatures(event.point, { layers: ['places'] })[0];
    if (place) return flyTo(place.geometry.coordinates);
    // Of several, the one whose line is nearest to the pointer.
    const features = at(event.point);
    if (!features.length) return state.choose(-1);
    const distance = (id) => nearest(state.shownGeometry(state.layer, id), event.point);
    const ids = [...new Set(features.map((feature) => feature.id))];
    ids.sort((a, b) => distance(a) - distance(b) || a - b);
    return state.choose(ids[0]);
  }

  // Distance of a geometry from a point of the screen, in pixels.
  function nearest(geometry, point) {
    const line = geometry.type === 'Polygon' ? geometry.coordinates[0] : geometry.coordinates;
    const pixels = line.map((vertex) => map.project(vertex));
    let best = Infinity;
    for (let i = 0; i + 1 < pixels.length; i += 1) {
      const [a, b] = [pixels[i], pixels[i + 1]];
      const [dx, dy] = [b.x - a.x, b.y - a.y];
      const along = Math.max(0, Math.min(1, ((point.x - a.x) * dx + (point.y - a.y) * dy) / (dx * dx + dy * dy || 1)));
      best = Math.min(best, Math.hypot(a.x + along * dx - point.x, a.y + along * dy - point.y));
    }
    return best;
  }

  // The whole layer goes to the map once; filters then choose from it.
  function drawLayer() {
    const { layer } = state;
    const [features, dots] = [[], []];
    for (let at = 0; at < layer.change.length; at += 1) {
      const geometry = state.shownGeometry(layer, at);
      if (!geometry) continue;
      const properties = { v: layer.verdict[at], k: layer.kind[at], p: state.posteriorOf(layer, at), n: layer.vehicles[at] };
      features.push({ type: 'Feature', id: at, properties, geometry });
      dots.push({ type: 'Feature', id: at, properties, geometry: { type: 'Point', coordinates: middle(geometry) } });
    }
    map.getSource('changes').setData({ type: 'FeatureCollection', features });
    map.getSource('dots').setData({ type: 'FeatureCollection', features: dots });
    map.getSource('regions').setData({
      type: 'FeatureCollection',
      features: layer.regions.map((region, id) => ({ type: 'Feature', id, properties: {}, geometry: { type: 'Polygon', coordinates: [[...region.outline, region.outline[0]]] } })),
    });
    map.getSource('map').setTiles([`tilefold://${mapKey()}/{z}/{x}/{y}`]);
    drawDecisions();
    if (shownLayers.coverage) drawCoverage();
  }

  function middle(geometry) {
    const line = geometry.type === 'Polygon' ? geometry.coordinates[0] : geometry.coordinates;
    return line[Math.floor(line.length / 2)];
  }

  // The filters as an expression, so that the map needs no new data.
  function expression() {
    const { filters, index, shown } = state;
    const reviewsAll = filters.reviews.size === 4;
    if (filters.text || !reviewsAll) return shown.length ? ['match', ['id'], shown, true, false] : false;
    const codes = (names, set) => ['literal', names.map((name, at) => (set.has(name) ? at : -1)).filter((at) => at >= 0)];
    const claims = ['literal', ['added', 'removed', 'modified'].map(code)];
    return ['all',
      ['in', ['get', 'v'], codes(index.names.verdicts, filters.verdicts)],
      ['in', ['get', 'k'], codes(index.names.kinds, filters.kinds)],
      ['any', ['!', ['in', ['get', 'v'], claims]],
        ['all', ['>=', ['get', 'p'], filters.posterior], ['>=', ['get', 'n'], filters.vehicles]]]];
  }

  let lastExpression = '';
  function drawFilter() {
    const wanted = expression();
    const text = JSON.stringify([wanted, state.layer.version]);
    if (text === lastExpression) return;
    lastExpression = text;
    const gone = ['==', ['get', 'v'], code('removed')];
    map.setFilter('changes', ['all', wanted, ['!', gone]]);
    map.setFilter('changes-gone', ['all', wanted, gone]);
    map.setFilter('changes-fill', ['all', wanted, isArea]);
    map.setFilter('dots', ['all', wanted]);
    map.setFilter('regions', regionsShown());
  }

  // Only regions with something in them that is shown; of very many, all.
  function regionsShown() {
    const { layer, shown } = state;
    if (layer.regions.length > 20_000) return true;
    const ids = [...new Set(shown.map((at) => layer.region[at]).filter((id) => id !== null))];
    return ids.length ? ['match', ['id'], ids, true, false] : false;
  }

  function drawDecisions() {
    const { layer, decisions } = state;
    for (const source of ['changes', 'dots']) {
      map.removeFeatureState({ source });
      layer.change.forEach((change, id) => {
        const said = decisions.get(change)?.decision;
        if (said) map.setFeatureState({ source, id }, { said });
      });
    }
  }

  // Both sides of a line at a distance, as a polygon.
  function band(line, metres) {
    const scale = Math.cos((line[0][1] * Math.PI) / 180) * 111195;
    const beside = (side) => line.map(([x, y], i) => {
      const [ax, ay] = line[Math.max(0, i - 1)];
      const [bx, by] = line[Math.min(line.length - 1, i + 1)];
      const [dx, dy] = [(bx - ax) * scale, (by - ay) * 111195];
      const length = Math.hypot(dx, dy) || 1;
      return [x - (side * metres * dy) / length / scale, y + (side * metres * dx) / length / 111195];
    });
    const [left, right] = [beside(1), beside(-1).reverse()];
    return { type: 'Polygon', coordinates: [[...left, ...right, left[0]]] };
  }

  function drawChosen() {
    const { layer, chosen } = state;
    // The panel beside the map comes and goes with what is chosen.
    map.resize();
    if (chosen < 0) return map.getSource('chosen').setData(EMPTY);
    const colours = palette();
    const verdict = state.verdictOf(layer, chosen);
    const colour = colours[verdict] ?? colours.unknown;
    const features = [];
    const add = (role, geometry, colour) => geometry && features.push({ type: 'Feature', properties: { role, colour }, geometry });
    const [was, is] = [state.geometry(layer.old[chosen]), state.geometry(layer.new[chosen])];
    const sigma = layer.shift_sigma_m[chosen];
    if (is?.type === 'LineString' && sigma) add('band', band(is.coordinates, 1.645 * sigma), colour);
    add('old', was, is ? colours.old : colour);
    add('new', is, colour);
    map.getSource('chosen').setData({ type: 'FeatureCollection', features });
    look([was, is].filter(Boolean));
    return undefined;
  }

  // Brings geometries into view, no farther than needed.
  function look(geometries) {
    const points = geometries.flatMap((geometry) => (geometry.type === 'Polygon' ? geometry.coordinates[0] : geometry.coordinates));
    if (!points.length) return;
    const bounds = points.reduce((all, point) => all.extend(point), new maplibregl.LngLatBounds());
    const camera = map.cameraForBounds(bounds, { padding: 90, maxZoom: 19.5 });
    const isThere = map.getZoom() >= Math.min(17, camera.zoom - 1) && map.getBounds().contains(bounds.getNorthEast()) && map.getBounds().contains(bounds.getSouthWest());
    if (!isThere) move(camera);
  }

  function move(camera) {
    const isStill = matchMedia('(prefers-reduced-motion: reduce)').matches;
    if (isStill) map.jumpTo(camera);
    else map.easeTo({ ...camera, duration: 450 });
  }

  const flyTo = (center) => move({ center, zoom: 17 });

  // Where vehicles looked, fetched when it is first asked for.
  async function drawCoverage() {
    const version = state.layer.version;
    if (coverage?.version !== version) coverage = { version, ...await tilefold.load(`coverage/${version}`) };
    const side = 2 ** coverage.zoom;
    const longitude = (x) => (x / side - 0.5) * 360;
    const latitude = (y) => (Math.atan(Math.sinh(Math.PI * (1 - (2 * y) / side))) * 180) / Math.PI;
    const features = coverage.column.map((x, at) => {
      const y = coverage.row[at];
      const [west, east, north, south] = [longitude(x), longitude(x + 1), latitude(y), latitude(y + 1)];
      const vehicles = coverage.vehicles[at];
      const s = vehicles === 0 ? 0 : vehicles < coverage.enough ? 1 : 2;
      return { type: 'Feature', properties: { s }, geometry: { type: 'Polygon', coordinates: [[[west, south], [east, south], [east, north], [west, north], [west, south]]] } };
    });
    map.getSource('coverage').setData({ type: 'FeatureCollection', features });
    map.getSource('places').setData({
      type: 'FeatureCollection',
      features: coverage.places.map((place, at) => ({ type: 'Feature', properties: { n: at + 1 }, geometry: { type: 'Point', coordinates: [place.longitude, place.latitude] } })),
    });
    drawPlaces();
  }

  function drawPlaces() {
    const { many, metres } = tilefold;
    const panel = byId('places');
    panel.hidden = !shownLayers.coverage;
    if (panel.hidden) return;
    const told = (place) => [
      place.unseen_m > 0 && `${metres(place.unseen_m)} of paint unseen`,
      place.thin_m > 0 && `${metres(place.thin_m)} seen by fewer than ${coverage.enough}`,
      place.open > 0 && many(place.open, 'open verdict'),
    ].filter(Boolean).join(' · ');
    const items = coverage.places.map((place) => el('li', {}, el('button', { type: 'button', class: 'plain', onclick: () => flyTo([place.longitude, place.latitude]) }, told(place))));
    const list = items.length ? el('ol', {}, ...items) : el('p', { class: 'quiet' }, 'Every cell was seen by enough vehicles.');
    panel.replaceChildren(el('h2', {}, 'Where to drive next'), list);
  }

  function toggle(name) {
    shownLayers[name] = !shownLayers[name];
    const ids = { map: ['crosswalks', 'signs', 'stop-lines', 'lines', 'dashed-lines'], regions: ['regions'], coverage: ['coverage', 'places', 'places-number'] }[name];
    for (const id of ids) map.setLayoutProperty(id, 'visibility', shownLayers[name] ? 'visible' : 'none');
    if (name === 'coverage') {
      if (shownLayers.coverage) drawCoverage().catch(tilefold.complain);
      else drawPlaces();
    }
    drawLegend();
  }

  function drawLegend() {
    const switches = [['map', 'Map', 'm'], ['regions', 'Regions', 'g'], ['coverage', 'Coverage', 'c']];
    const button = ([name, label, key]) => el('button', {
      type: 'button', class: 'chip', 'aria-pressed': String(shownLayers[name]), title: `${label} (${key})`, onclick: () => toggle(name),
    }, label);
    const key = shownLayers.coverage && el('div', { class: 'key' },
      ...[['unseen', 'nobody looked'], ['thin', 'too few vehicles'], ['enough', 'seen']].map(([of, words]) => el('span', {}, el('i', { class: `swatch ${of}` }), words)));
    byId('legend').replaceChildren(el('div', { class: 'chips' }, ...switches.map(button)), ...(key ? [key] : []));
  }

  // The same view in other colours: paint only, the data stays.
  function recolour() {
    const wanted = style();
    for (const layer of wanted.layers) {
      for (const [name, value] of Object.entries(layer.paint)) map.setPaintProperty(layer.id, name, value);
    }
    drawChosen();
  }

  Object.assign(tilefold, { startMap: start, toggleLayer: toggle, recolour, isDark });
})();
