/** Files that are dropped or chosen. */

import { byId } from './dom';

/** Calls `open` with each file that comes. */
export function setUpFiles(open: (file: File) => void): void {
    const input = byId<HTMLInputElement>('file');
    for (const id of ['tool-open', 'welcome-open']) byId(id).addEventListener('click', () => input.click());
    input.addEventListener('change', () => {
        const file = input.files?.[0];
        input.value = ''; // so that the same file can be chosen again
        if (file) open(file);
    });
    const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes('Files') ?? false;
    const show = (shown: boolean) => { byId('drop').hidden = !shown; };
    addEventListener('dragover', (event) => {
        if (!hasFiles(event)) return;
        event.preventDefault();
        show(true);
    });
    addEventListener('dragleave', (event) => { if (!event.relatedTarget) show(false); });
    addEventListener('drop', (event) => {
        show(false);
        if (!hasFiles(event)) return;
        event.preventDefault();
        const file = event.dataTransfer!.files[0];
        if (file) open(file);
    });
}

/** Hands a file to the user. */
export function save(blob: Blob, name: string): void {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
