// What the reviewer says of a change: sent to the server that keeps it, or, where there is none,
// kept by the browser until it is saved to a file.
'use strict';

(() => {
  const { state, el, byId, saidName, verdictName } = tilefold;
  const SAY = [['accept', 'Accept', 'A'], ['reject', 'Reject', 'R'], ['later', 'Later', 'L']];
  const kept = () => `tilefold decisions ${state.index.title} ${state.index.bounds.join(' ')}`;

  function decisionForm(layer, at) {
    if (!canDecide()) return el('footer', { class: 'decide' }, el('p', { class: 'quiet' }, 'Decisions are not taken here: serve with --decisions FILE.'));
    const last = state.decisions.get(layer.change[at]);
    const button = ([say, label, key]) => el('button', {
      type: 'button', class: `say ${say}`, id: `say-${say}`, 'aria-pressed': String(last?.decision === say), title: `${label} (${key.toLowerCase()})`, onclick: () => decide(say),
    }, label, el('kbd', {}, key));
    return el('footer', { class: 'decide' },
      last ? said(last, layer, at) : null,
      el('div', { class: 'says' }, ...SAY.map(button)),
      el('textarea', { id: 'note', rows: 1, maxlength: 2000, placeholder: 'Note (n)', 'aria-label': 'Note' }, last?.note ?? ''),
      el('div', { class: 'row' },
        el('input', { id: 'reviewer', maxlength: 100, placeholder: 'Your name', 'aria-label': 'Your name', autocomplete: 'name', value: remembered(), onchange: (event) => remember(event.target.value) }),
        last ? el('button', { type: 'button', class: 'link', onclick: () => decide('undo') }, 'Take back') : null));
  }

  function said(last, layer, at) {
    const now = state.verdictOf(layer, at);
    const who = [last.reviewer, last.at?.slice(0, 10), `version ${last.version}`].filter(Boolean).join(', ');
    const other = last.verdict !== now && `; it was ${verdictName(last.verdict).toLowerCase()} then`;
    return el('p', { class: 'quiet' }, el('span', { class: `said ${last.decision}` }, saidName(last.decision)), ` ${who}${other || ''}`);
  }

  const canDecide = () => !tilefold.isServed || state.index.can_decide;

  function remembered() {
    try {
      return localStorage.getItem('tilefold reviewer') ?? '';
    } catch {
      return '';
    }
  }

  function remember(name) {
    try {
      localStorage.setItem('tilefold reviewer', name);
    } catch { /* A browser that keeps nothing asks again. */ }
  }

  async function decide(decision) {
    const { layer, chosen } = state;
    if (chosen < 0 || !canDecide()) return;
    const asked = {
      change: layer.change[chosen], version: layer.version, decision, note: byId('note').value, reviewer: byId('reviewer').value.trim(),
    };
    try {
      const done = tilefold.isServed ? await tilefold.post('decisions', asked) : {
        ...asked, element_id: layer.element[chosen], verdict: state.verdictOf(layer, chosen), at: `${new Date().toISOString().slice(0, 19)}Z`,
      };
      state.keepDecision(done);
      if (!tilefold.isServed) keepHere(done);
      tilefold.toast(decision === 'undo' ? 'Taken back' : saidName(decision));
      state.tell('decisions');
      if (state.chosen !== chosen) return;
      const next = decision === 'undo' ? undefined : state.step(1, (at) => !state.decisions.has(layer.change[at]));
      if (next === undefined && state.chosen === chosen) state.tell('chosen');
    } catch (error) {
      tilefold.complain(error);
    }
  }

  // Without a server: everything that was said here, also what was taken back.
  let here = [];
  function keepHere(decision) {
    here.push(decision);
    try {
      localStorage.setItem(kept(), JSON.stringify(here));
    } catch { /* The button to save is all there is. */ }
    offerToSave();
  }

  function offerToSave() {
    const button = byId('save');
    button.hidden = here.length === 0;
    button.onclick = () => {
      const lines = here.map((decision) => `${JSON.stringify(decision)}\n`);
      const link = el('a', { download: 'decisions.jsonl', href: URL.createObjectURL(new Blob(lines, { type: 'application/x-ndjson' })) });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    };
  }

  async function readDecisions() {
    for (const decision of await tilefold.load('decisions')) state.keepDecision(decision);
    if (tilefold.isServed) return;
    try {
      here = JSON.parse(localStorage.getItem(kept()) ?? '[]');
    } catch {
      here = [];
    }
    here.forEach(state.keepDecision);
    offerToSave();
  }

  Object.assign(tilefold, { decisionForm, decide, readDecisions });
})();
