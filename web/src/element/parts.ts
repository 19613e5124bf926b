/** What the element is made of. */

const STYLE = `
:host { display: block; position: relative; min-height: 8em; contain: content; }
:host([hidden]) { display: none; }
canvas { display: block; width: 100%; height: 100%; position: absolute; inset: 0; outline-offset: -2px; object-fit: contain; }
.still { pointer-events: none; }
.still[hidden] { display: none; }
:has(+ .still:not([hidden])) { opacity: 0; }
progress { position: absolute; inset: auto 0 0 0; width: 100%; height: 3px; appearance: none; border: 0; background: transparent; }
progress::-webkit-progress-bar { background: transparent; }
progress::-webkit-progress-value, progress::-moz-progress-bar { background: currentColor; }
progress[hidden] { display: none; }
[part=error] { position: absolute; inset: 0; display: grid; place-items: center; padding: 1em; text-align: center; }
[part=error]:empty, slot[hidden] { display: none; }
`;

export class Parts {
    readonly canvas = document.createElement('canvas');
    /** The last image, while there is no context. */
    readonly still = document.createElement('canvas');
    readonly bar = document.createElement('progress');
    readonly failure = document.createElement('div');
    readonly poster = document.createElement('slot');

    /** Puts them into the shadow of `host`. */
    constructor(host: HTMLElement) {
        const root = host.attachShadow({ mode: 'open' });
        const sheet = new CSSStyleSheet(); // allowed by any Content-Security-Policy, unlike <style>
        sheet.replaceSync(STYLE);
        root.adoptedStyleSheets = [sheet];
        this.poster.name = 'poster';
        this.bar.hidden = true;
        this.bar.part.add('progress');
        this.failure.part.add('error');
        this.failure.setAttribute('role', 'alert');
        for (const canvas of [this.canvas, this.still]) canvas.part.add('canvas');
        this.still.className = 'still';
        this.still.hidden = true;
        root.append(this.canvas, this.still, this.poster, this.bar, this.failure, document.createElement('slot'));
    }

    showProgress(bytes: number, totalBytes: number): void {
        this.poster.hidden = true;
        this.bar.hidden = false;
        this.bar.max = totalBytes;
        this.bar.value = bytes;
    }

    /** As before anything is shown. */
    clear(): void {
        this.failure.textContent = '';
        this.poster.hidden = false;
        this.bar.hidden = true;
    }

    /** The last image, as a PNG. */
    async stillBlob(): Promise<Blob> {
        const blob = await new Promise<Blob | null>((resolve) => this.still.toBlob(resolve));
        if (!blob) throw new Error('the browser makes no image');
        return blob;
    }
}
