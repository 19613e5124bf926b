import { SceneError } from '../scene';

/** A value of a file for a message: short, in quotes if it is a text, without control characters. */
export function shown(value: unknown): string {
    const text = Array.isArray(value) ? `${value.length} values` : (JSON.stringify(value) ?? 'nothing');
    return text.length > 60 ? `${text.slice(0, 60)}...` : text;
}

/**
 * Throws SceneError unless something holds; the message says what was found and what was expected. `kind` as in SceneError.
 */
export function check(
    holds: boolean,
    what: string,
    found: unknown,
    expected: unknown,
    kind: SceneError['kind'] = 'invalid',
): asserts holds {
    if (!holds) throw new SceneError(kind, `${what}: found ${shown(found)}, expected ${expected}`);
}

/** Throws SceneError unless a file has only what is supported here. */
export function support(holds: boolean, what: string, found: unknown, supported: unknown): asserts holds {
    check(holds, what, found, supported, 'unsupported');
}
