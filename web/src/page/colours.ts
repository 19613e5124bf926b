/** What the colours show, and their legend. */

import { CLASS_COLOURS, CLASS_LABELS, COLOURS, type Colours } from '../core/render/colours';
import { byId, make, radios } from './dom';

const LABELS: Record<Colours, string> = {
    trained: 'As trained', untextured: 'Without textures', texels: 'Texels', degree: 'SH degree', depth: 'Depth',
};
const TITLES: Partial<Record<Colours, string>> = {
    texels: 'Texels along the longer side of the map', degree: 'SH degree of the splat', depth: 'Depth, logarithmic',
};

export const ALL_COLOURS = Object.keys(COLOURS) as Colours[];

/** Sets the choice up. Returns what chooses from outside. */
export function setUpColours(changed: (colours: Colours) => void): (colours: Colours) => void {
    const options = ALL_COLOURS.map((value, i) => ({ value, label: LABELS[value], key: String(i + 1) }));
    return radios(byId('colours'), options, 'trained', (colours) => {
        showLegend(colours);
        changed(colours);
    }).choose;
}

function showLegend(colours: Colours): void {
    const title = TITLES[colours];
    byId('legend').hidden = !title;
    byId('legend-title').textContent = title ?? '';
    const list = byId('legend-classes');
    list.className = colours === 'depth' ? 'ramp' : '';
    if (colours === 'depth') return list.replaceChildren(make('i'), make('li', {}, 'near'), make('li', {}, 'far'));
    const labels = CLASS_LABELS[colours] ?? [];
    list.replaceChildren(...(CLASS_COLOURS[colours] ?? []).map((hex, i) => {
        const swatch = make('i');
        swatch.style.backgroundColor = hex;
        return make('li', {}, swatch, labels[i]);
    }));
}
