/** What the page has to say: one message per subject, which stays until its reason is gone or it is closed. */

import { byId, make } from './dom';

export interface MessageOptions {
    error?: boolean;
    /** A button besides that which closes the message. */
    action?: { label: string; run(): void };
    /** Stays until it is cleared. */
    lasting?: boolean;
}

const shown = new Map<string, HTMLElement>();

/** Shows a message about a subject, instead of the one before. */
export function say(subject: string, text: string, { error = false, action, lasting = false }: MessageOptions = {}): void {
    if (shown.get(subject)?.firstElementChild?.textContent === text) return;
    clear(subject);
    const message = make('div', { className: `message card${error ? ' error' : ''}` }, make('p', {}, text));
    message.setAttribute('role', error ? 'alert' : 'status');
    if (action) message.append(button(action.label, action.run));
    if (!lasting) message.append(button('Close', () => clear(subject)));
    shown.set(subject, message);
    byId('messages').append(message);
}

export function clear(subject: string): void {
    shown.get(subject)?.remove();
    shown.delete(subject);
}

/** Closes what can be closed. Returns whether there was something. */
export function closeLatest(): boolean {
    const latest = [...byId('messages').querySelectorAll('button')].filter((b) => b.textContent === 'Close').at(-1);
    latest?.click();
    return Boolean(latest);
}

function button(label: string, run: () => void): HTMLButtonElement {
    const element = make('button', { type: 'button', className: 'action' }, label);
    element.addEventListener('click', run);
    return element;
}
