/** Keys of the page, and the overlay that lists them. Those that move the camera are in the controls. */

import { needsLetters } from '../viewer/controls';
import { byId, make } from './dom';

export interface Shortcut {
    /** What `KeyboardEvent.key` says, in lower case. */
    readonly keys: readonly string[];
    readonly help: string;
    run(key: string): void;
}

const MOVES: readonly (readonly [keys: readonly string[], help: string])[] = [
    [['drag', 'one finger'], 'turn around the scene; in flight: look around'],
    [['right drag', 'two fingers'], 'shift the scene'],
    [['wheel', 'pinch'], 'come closer, go away, to where the pointer is'],
    [['double click', 'double tap'], 'turn around what is there'],
    [['←', '→', '↑', '↓'], 'turn'],
    [['W', 'A', 'S', 'D', 'Q', 'E'], 'move'],
];

const help = () => byId<HTMLDialogElement>('help');

/** Sets the keys up, and fills the overlay. */
export function setUpKeys(shortcuts: readonly Shortcut[], escape: () => void): void {
    const rows = [...MOVES, ...shortcuts.map(({ keys, help: text }) => [keys.map((key) => key.toUpperCase()), text] as const)];
    byId('help-keys').replaceChildren(...rows.map(([keys, text]) => {
        const head = make('th', { scope: 'row' }, ...keys.map((key) => make('kbd', {}, key)));
        return make('tr', {}, head, make('td', {}, text));
    }));
    addEventListener('keydown', (event) => {
        if (event.key === 'Tab') document.documentElement.classList.add('tabbed');
        if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || help().open) return;
        if (event.key === 'Escape') return escape();
        if (needsLetters(event.composedPath()[0] as Element)) return;
        const key = event.key.toLowerCase();
        const shortcut = shortcuts.find(({ keys }) => keys.includes(key));
        if (!shortcut || event.repeat) return;
        event.preventDefault();
        shortcut.run(key);
    });
    byId('help-close').addEventListener('click', () => help().close());
    // A click on the backdrop is one on the dialog itself, whose content fills it.
    help().addEventListener('click', (event) => { if (event.target === help()) help().close(); });
}

/** Shows the overlay, which Escape closes. */
export function showHelp(): void {
    help().showModal();
}
