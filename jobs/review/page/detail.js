// The panel of the chosen change: how sure, what speaks for and against, where to look, and the
// reviewer's word.
'use strict';

(() => {
  const { state, el, svg, byId, spaced, verdictName, kindName, percent, many, nats, day, time } = tilefold;
  const panel = byId('detail');
  const PASSES = 8;
  let asked = 0;

  function draw() {
    const { layer, chosen } = state;
    panel.hidden = chosen < 0;
    document.body.classList.toggle('has-detail', chosen >= 0);
    if (chosen < 0) return panel.replaceChildren();
    const why = el('div', { class: 'why' }, el('p', { class: 'quiet' }, 'Reading the evidence …'));
    panel.replaceChildren(
      heading(layer, chosen),
      el('div', { class: 'scroll', tabindex: '0' }, posterior(layer, chosen), facts(layer, chosen), why),
      tilefold.decisionForm(layer, chosen),
    );
    return explain(layer, chosen, why);
  }

  function heading(layer, at) {
    const verdict = state.verdictOf(layer, at);
    const element = layer.element[at];
    const stretch = layer.to_m[at] > layer.from_m[at] && state.kindOf(layer, at) === 'lane_marking'
      ? `${layer.from_m[at].toFixed(0)} to ${layer.to_m[at].toFixed(0)} m` : null;
    const parts = [element === null ? 'not in the map' : `element ${element}`, stretch].filter(Boolean);
    return el('header', {},
      el('i', { class: `swatch ${verdict}` }),
      el('div', {},
        el('h2', {}, `${kindName(state.kindOf(layer, at))} ${verdictName(verdict).toLowerCase()}`),
        el('p', { class: 'quiet' }, parts.join(' · '), el('code', {}, layer.change[at]))),
      el('button', { type: 'button', class: 'plain', title: 'Close (Esc)', 'aria-label': 'Close', onclick: () => state.choose(-1) }, '✕'));
  }

  function posterior(layer, at) {
    const names = ['no_change', 'added', 'removed', 'modified'];
    const rows = layer.posterior[at].map((value, of) => {
      const bar = el('span', { class: `bar ${names[of]}` });
      bar.style.width = `${value / 10}%`;
      return el('div', { class: 'hypothesis' },
        el('span', {}, verdictName(names[of])), el('span', { class: 'track' }, bar), el('span', { class: 'number' }, percent(value)));
    });
    return el('section', { 'aria-label': 'Posterior' }, el('h3', {}, 'Posterior'), ...rows);
  }

  function facts(layer, at) {
    const pairs = [];
    const fact = (name, value) => value && pairs.push(el('dt', {}, name), el('dd', {}, value));
    const looked = `${many(layer.vehicles[at], 'vehicle')} in ${many(layer.passes[at], 'pass', 'passes')}`;
    fact('Looked', layer.vehicles[at] ? looked : 'nobody yet');
    if (layer.element[at] !== null && layer.exposed[at]) fact('Matched', `in ${layer.hit[at].toLocaleString('en')} of ${many(layer.exposed[at], 'look')}`);
    if (layer.vehicles[at]) fact('Seen', `${day(layer.first_s[at])} to ${day(layer.last_s[at])}`);
    const [after, before] = [layer.changed_after_s[at], layer.changed_before_s[at]];
    if (after !== null && before !== null) fact('It changed', `between ${day(after)} and ${day(before)}`);
    const shift = layer.shift_m[at];
    if (shift !== null && Math.abs(shift) >= 0.05) {
      const sigma = layer.shift_sigma_m[at];
      fact('Shift', `${Math.abs(shift).toFixed(2)} m to the ${shift < 0 ? 'right' : 'left'}${sigma ? ` ± ${(1.645 * sigma).toFixed(2)} m (90 %)` : ''}`);
    }
    const [mapped, observed] = [state.className(layer, at, layer.class_mapped), state.className(layer, at, layer.class_observed)];
    if (mapped && observed && mapped !== observed) fact('Type', el('span', { class: 'types' }, type(mapped), el('span', { 'aria-label': 'became' }, '→'), type(observed)));
    else if (mapped ?? observed) fact('Type', type(mapped ?? observed));
    const region = layer.regions[layer.region[at]];
    if (region && region.changes > 1) fact('Region', region.summary);
    return el('section', {}, el('dl', {}, ...pairs));
  }

  // The name of a marking or a sign; arrows with their picture.
  const ARROWS = {
    straight_arrow: ['M12 21V4', 'm8 8 4-4 4 4'],
    left_arrow: ['M14 21v-9a2 2 0 0 0-2-2H5', 'm9 6-4 4 4 4'],
    right_arrow: ['M10 21v-9a2 2 0 0 1 2-2h7', 'm15 6 4 4-4 4'],
    straight_left_arrow: ['M14 21V4m0 11H5', 'm10.5 7.5 3.5-3.5 3.5 3.5M8.5 11.5 5 15l3.5 3.5'],
    straight_right_arrow: ['M10 21V4m0 11h9', 'm6.5 7.5 3.5-3.5 3.5 3.5M15.5 11.5 19 15l-3.5 3.5'],
  };
  function type(name) {
    const paths = ARROWS[name];
    const picture = paths && svg('svg', { viewBox: '0 0 24 24', width: 18, height: 18, class: 'arrow', 'aria-hidden': 'true' }, ...paths.map((d) => svg('path', { d })));
    return el('span', { class: 'type' }, picture || null, spaced(name));
  }

  async function explain(layer, at, why) {
    asked += 1;
    const turn = asked;
    let told = null;
    try {
      told = await tilefold.explanation(layer.version, layer.change[at], layer.tile[at]);
    } catch (error) {
      if (turn === asked) why.replaceChildren(el('p', { class: 'error' }, error.message));
      return;
    }
    // The reviewer may be at the next one by now.
    if (turn !== asked) return;
    if (!told) {
      why.replaceChildren(el('p', { class: 'quiet' }, `This folder has no evidence of it. With the store: tilefold explain STORE ${layer.change[at]} --version ${layer.version}`));
      return;
    }
    why.replaceChildren(...[sums(told), evidence(told), flip(told), frames(told), models(told)].filter(Boolean));
  }

  function sums(told) {
    return el('section', {}, el('h3', {}, 'What speaks'),
      el('p', {}, `${nats(told.log_odds)} nats of ${spaced(told.likeliest_change)} against no change: ${nats(told.evidence)} from ${many(told.passes.length, 'pass', 'passes')}, ${nats(told.rest)} from the prior and the neighbourhood.`));
  }

  function evidence(told) {
    if (!told.passes.length) return null;
    const rows = told.passes.map((pass) => el('tr', {},
      el('td', { class: `number ${pass.for_change > 0 ? 'for' : 'against'}` }, nats(pass.for_change)),
      el('td', {}, pass.why, el('span', { class: 'quiet block' }, `${time(pass.first_ns)} · vehicle ${pass.vehicle.slice(0, 8)}`))));
    const table = el('table', {}, el('thead', {}, el('tr', {}, el('th', { scope: 'col' }, 'nats'), el('th', { scope: 'col' }, 'pass'))), el('tbody', {}, ...rows.slice(0, PASSES)));
    const more = rows.length > PASSES && el('button', { type: 'button', class: 'link', onclick: (event) => {
      table.tBodies[0].append(...rows.slice(PASSES));
      event.target.remove();
    } }, `Show ${many(rows.length - PASSES, 'more pass', 'more passes')}`);
    const less = told.believed_less.map((vehicle) => el('p', { class: 'quiet' }, `Vehicle ${vehicle.vehicle.slice(0, 8)} is believed less: it ${vehicle.why}.`));
    return el('section', {}, el('h3', {}, 'By vehicle, over time'), chart(told), table, more || null, ...less);
  }

  // One mark a pass: up is for the change, down against it. Passes of one vehicle are joined.
  function chart(told) {
    const [width, height, left, right, top, bottom] = [340, 132, 44, 8, 8, 20];
    const { passes } = told;
    const times = passes.map((pass) => pass.first_ns);
    const [from, to] = [Math.min(...times), Math.max(...times)];
    const most = Math.max(1, ...passes.map((pass) => Math.abs(pass.for_change)));
    const x = (stamp) => (to > from ? left + ((stamp - from) / (to - from)) * (width - left - right) : (left + width - right) / 2);
    const y = (value) => top + (1 - value / most) * ((height - top - bottom) / 2);
    const marks = [];
    const byVehicle = new Map();
    for (const pass of passes) byVehicle.set(pass.vehicle, [...(byVehicle.get(pass.vehicle) ?? []), pass]);
    for (const [vehicle, its] of byVehicle) {
      its.sort((a, b) => a.first_ns - b.first_ns);
      const points = its.map((pass) => `${x(pass.first_ns).toFixed(1)},${y(pass.for_change).toFixed(1)}`).join(' ');
      if (its.length > 1) marks.push(svg('polyline', { points, class: 'thread' }));
      for (const pass of its) {
        const title = svg('title', {}, `vehicle ${vehicle.slice(0, 8)}, ${time(pass.first_ns)}: ${nats(pass.for_change)} nats, ${pass.why}`);
        marks.push(svg('circle', { cx: x(pass.first_ns).toFixed(1), cy: y(pass.for_change).toFixed(1), r: 3.6, class: pass.for_change > 0 ? 'for' : 'against' }, title));
      }
    }
    const after = told.changed_before_ns;
    if (after && after >= from && after <= to) marks.unshift(svg('line', { x1: x(after), x2: x(after), y1: top, y2: height - bottom, class: 'since' }));
    const label = (words, at, anchor, line) => svg('text', { x: at, y: line, 'text-anchor': anchor }, words);
    return svg('svg', { viewBox: `0 0 ${width} ${height}`, class: 'chart', role: 'img', 'aria-label': `${passes.length} passes over time, in nats for the change` },
      svg('line', { x1: left, x2: width - right, y1: y(0), y2: y(0), class: 'axis' }),
      label(nats(most), left - 4, 'end', y(most) + 7), label('0', left - 4, 'end', y(0) + 3), label(nats(-most), left - 4, 'end', y(-most)),
      label(day(from / 1e9), left, 'start', height - 4), to > from ? label(day(to / 1e9), width - right, 'end', height - 4) : null,
      ...marks);
  }

  function flip(told) {
    const words = told.flip
      ? `${many(told.flip.passes, 'more vehicle')} that ${told.flip.passes === 1 ? 'sees' : 'see'} ${told.flip.see_it ? 'it as mapped' : 'nothing there'} would make it ${verdictName(told.flip.verdict).toLowerCase()}.`
      : 'No number of further passes that was tried would change the verdict.';
    return el('section', {}, el('h3', {}, 'What would change that'), el('p', {}, words),
      told.agrees ? null : el('p', { class: 'error' }, 'Folding this evidence now gives another record: it was made by another version of the program.'));
  }

  function frames(told) {
    if (!told.frames.length) return null;
    const items = told.frames.map((frame, place) => {
      const log = frame.log?.split('\n').at(-1) ?? 'a log that the store does not know';
      const name = log.split('/').at(-1);
      return el('li', {},
        el('span', { class: `number ${frame.for_change > 0 ? 'for' : 'against'}` }, nats(frame.for_change)),
        el('span', {}, el('span', { title: log }, name), el('span', { class: 'quiet block' }, [time(frame.stamp_ns), frame.topic].filter(Boolean).join(' · ')), el('code', { class: 'block' }, `${frame.stamp_ns} ns`), picture(told, place)));
    });
    return el('section', {}, el('h3', {}, 'Frames to look at'), el('ul', { class: 'frames' }, ...items));
  }

  // A frame is drawn when it is asked for: that takes the server a second or more.
  function picture(told, place) {
    if (!state.index.has_frames) return null;
    const button = el('button', { type: 'button', class: 'link', onclick: async () => {
      button.disabled = true;
      button.textContent = 'Drawing it …';
      try {
        const alt = 'What the camera saw: the map in blue, what was detected in yellow, changes in green, red and orange';
        const link = await tilefold.picture(told.version, told.change, place);
        button.replaceWith(el('a', { href: link, target: '_blank', title: 'Open it large' }, el('img', { class: 'frame', src: link, alt })));
      } catch (error) {
        button.replaceWith(el('span', { class: 'error block' }, error.message));
      }
    } }, 'Show the picture');
    return button;
  }

  function models(told) {
    return el('p', { class: 'quiet small' }, `Version ${told.version}, fusion model ${told.fusion_model}, sensor model ${told.sensor_model}`);
  }

  state.on('chosen', draw);
})();
