/** Numbers as people read them. */

/** A count, with separators of thousands. */
export const count = (n: number): string => Math.round(n).toLocaleString('en');

/** Bytes with a decimal prefix and three digits. */
export function bytes(n: number): string {
    const units = ['B', 'kB', 'MB', 'GB'];
    let unit = 0;
    for (; n >= 999.5 && unit < 3; unit++) n /= 1000;
    return `${unit === 0 || n >= 99.95 ? Math.round(n) : n.toPrecision(n >= 9.995 ? 3 : 2)} ${units[unit]}`;
}

/** Milliseconds, coarser the longer. */
export const milliseconds = (ms: number): string => (ms < 1000 ? `${ms < 9.95 ? ms.toFixed(1) : Math.round(ms)} ms` : `${(ms / 1000).toFixed(1)} s`);

/** Time left, as minutes and seconds or hours and minutes. */
export function duration(secs: number): string {
    const s = Math.round(secs);
    if (s < 60) return `${s} s`;
    if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
    return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
}

/** A name for a file, of what others say: letters, digits and a few signs, not too long. */
export function fileName(...parts: string[]): string {
    const clean = (part: string) => part.replace(/\.(jpe?g|png|webp|exr|tiff?|ltgs|glb|html)$/i, '').replace(/[^\p{L}\p{N}._-]+/gu, '-').replace(/^[-.]+|[-.]+$/g, '');
    return parts.map(clean).filter(Boolean).join('-').slice(0, 100) || 'scene';
}
