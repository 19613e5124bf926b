/** The tools at the edge of the page, and the panel that they open: one section at a time. */

import { byId } from './dom';

const buttons = () => [...document.querySelectorAll<HTMLButtonElement>('#tools [data-panel]')];

let changed: (name: string | null) => void;

/** Sets the panel up; `told` is called with the name of the section that is shown, or null. */
export function setUpPanels(told: typeof changed): void {
    changed = told;
    for (const button of document.querySelectorAll<HTMLButtonElement>('#tools button')) button.setAttribute('aria-label', button.title);
    for (const button of buttons()) {
        button.setAttribute('aria-expanded', 'false');
        button.setAttribute('aria-controls', 'panel');
        button.addEventListener('click', () => toggle(button.dataset.panel!));
    }
    byId('panel-close').addEventListener('click', closePanel);
}

/** Name of the section that is open. */
export function openPanel(): string | null {
    return buttons().find((button) => button.getAttribute('aria-expanded') === 'true')?.dataset.panel ?? null;
}

/** Opens a section as its button does, or closes it. */
export function pressTool(name: string): void {
    byId(`tool-${name}`).click();
}

/** Closes the panel; the focus goes back to the tool. Returns whether it was open. */
export function closePanel(): boolean {
    const name = openPanel();
    if (name) {
        toggle(name);
        byId(`tool-${name}`).focus();
    }
    return Boolean(name);
}

function toggle(name: string): void {
    const open = openPanel() !== name;
    for (const button of buttons()) button.setAttribute('aria-expanded', String(open && button.dataset.panel === name));
    for (const section of document.querySelectorAll<HTMLElement>('#panel section')) section.hidden = section.id !== `panel-${name}`;
    byId('panel').hidden = !open;
    byId('panel-title').textContent = byId(`panel-${name}`).dataset.title!;
    changed(openPanel());
}
