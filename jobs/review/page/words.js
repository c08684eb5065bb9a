// Names, numbers and elements of the page. Whatever comes from data becomes text, never markup.
'use strict';

(() => {
  const VERDICTS = {
    added: 'Added', removed: 'Removed', modified: 'Modified',
    unknown: 'Unknown', stale: 'Stale', no_change: 'No change',
  };
  const KINDS = {
    lane_marking: 'Lane marking', stop_line: 'Stop line',
    crosswalk: 'Crosswalk', ground_sign: 'Ground sign',
  };
  const SAID = { accept: 'Accepted', reject: 'Rejected', later: 'Later' };

  const spaced = (name) => String(name).replaceAll('_', ' ');
  const verdictName = (name) => VERDICTS[name] ?? spaced(name);
  const kindName = (name) => KINDS[name] ?? spaced(name);
  const saidName = (name) => SAID[name] ?? spaced(name);
  // Never "100 %" or "0 %": nothing is that sure.
  const percent = (thousandths) => {
    if (thousandths > 999) return '> 99.9 %';
    if (thousandths < 1) return '< 0.1 %';
    return `${(thousandths / 10).toFixed(thousandths >= 990 || thousandths < 10 ? 1 : 0)} %`;
  };
  const many = (count, one, more = `${one}s`) => `${count.toLocaleString('en')} ${count === 1 ? one : more}`;
  const metres = (value) => `${value.toLocaleString('en', { maximumFractionDigits: 0 })} m`;
  const nats = (value) => `${value < 0 ? '−' : '+'}${Math.abs(value).toFixed(2)}`;

  const DAY = new Intl.DateTimeFormat('en-GB', { day: 'numeric', month: 'short', year: 'numeric', timeZone: 'UTC' });
  const TIME = new Intl.DateTimeFormat('en-GB', {
    day: 'numeric', month: 'short', year: 'numeric', hour: '2-digit', minute: '2-digit', second: '2-digit', timeZone: 'UTC',
  });
  const day = (seconds) => DAY.format(new Date(seconds * 1000));
  const time = (nanoseconds) => TIME.format(new Date(nanoseconds / 1e6));

  // An element with properties, `class` and `data`, and children: elements or texts.
  function el(name, properties = {}, ...children) {
    const element = document.createElement(name);
    fill(element, properties, children);
    return element;
  }

  function svg(name, properties = {}, ...children) {
    const element = document.createElementNS('http://www.w3.org/2000/svg', name);
    fill(element, properties, children);
    return element;
  }

  function fill(element, properties, children) {
    for (const [key, value] of Object.entries(properties)) {
      if (value === undefined || value === null) continue;
      if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
      else element.setAttribute(key, value);
    }
    element.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  }

  const byId = (id) => document.getElementById(id);

  Object.assign(tilefold, {
    spaced, verdictName, kindName, saidName, percent, many, metres, nats, day, time, el, svg, byId,
  });
})();
