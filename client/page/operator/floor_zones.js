/** Zones on the floor plan, who is in them, and the newest events of rules. */

import { shortLabel } from '../people/names.js';
import { getJson } from '../shared/requests.js';
import { svgPoints } from './floor_tracks.js';
import { element, make, setLines, svg } from '../shared/dom.js';

/** @import {RuleEvent, Rules, Zone} from '../shared/api_types.js' */

const EVENTS = 8; // in the list
const NAME_SIZE = 0.03; // share of the plan's size

export class FloorZones {
  /** What is drawn, for the plan. */
  drawing = svg('g');

  /**
   * Show the zones and events of now.
   *
   * @param {number} size of the plan, in the floor's unit
   */
  async refresh(size) {
    /** @type {Rules} */
    const { units_per_meter: scale, zones, events } = await getJson('api/rules');
    const onFloor = zones.filter(({ camera }) => camera === null);
    this.drawing.replaceChildren(...onFloor.flatMap((zone) => draw(zone, scale, size)));
    const areas = zones.filter(({ area }) => area !== null);
    setLines(element('zone-people'), areas.map(({ zone, objects }) => `${zone}: ${people(objects) || 'no one'}`));
    const list = element('rule-events');
    list.replaceChildren(...events.slice(0, EVENTS).map(eventLine));
    list.previousElementSibling?.toggleAttribute('hidden', !events.length);
  }
}

/**
 * @param {Zone} zone
 * @param {number} scale units of the plan per meter
 * @param {number} size
 */
function draw({ zone, area, line }, scale, size) {
  const corners = (area ?? line ?? []).map(([x, y]) => /** @type {[number, number]} */ ([x * scale, y * scale]));
  const points = svgPoints(corners);
  const [x, y] = [0, 1].map((axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
  const name = svg('text', { x, y: -y, 'font-size': size * NAME_SIZE, class: 'name' });
  name.textContent = zone;
  return [svg(area ? 'polygon' : 'polyline', { points, class: 'zone' }), name];
}

/** @param {RuleEvent} event */
function eventLine({ time, rule, kind, phase, zone, objects, clip }) {
  const when = time === null ? '' : `${new Date(time).toLocaleTimeString()} `;
  const lasting = phase === 'once' ? '' : ` ${phase}`;
  const item = make('li', { textContent: `${when}${rule}: ${kind}${lasting}${zone ? ` ${zone}` : ''}: ${people(objects)} ` });
  if (clip !== null) item.append(make('a', { href: clip, textContent: 'Clip' }));
  return item;
}

/** @param {number[]} objects */
function people(objects) {
  return objects.map((object) => shortLabel(object)).join(', ');
}
