import { check } from './errors';

/** A JSON object of a file, whose members are not checked yet. */
export type Json = Readonly<Record<string, unknown>>;

/** Most objects and values in a text: parsed ones take up to a hundred times the memory. */
const OBJECTS_MAX = 2 ** 17;
const VALUES_MAX = 2 ** 21;

/** Parses UTF-8 as one JSON object. `name` is for messages, as in all functions here. */
export function parseJson(bytes: Uint8Array, name: string): Json {
    let objects = 0;
    let values = 0;
    for (const byte of bytes) {
        if (byte === 0x7b) objects += 1;
        else if (byte === 0x2c || byte === 0x5b) values += 1;
    }
    check(objects <= OBJECTS_MAX && values <= VALUES_MAX, `${name}: objects and values`, objects + values, `fewer`);
    let value: unknown;
    try {
        value = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes));
    } catch (error) {
        check(false, name, String(error), 'JSON');
    }
    return objectOf(value, name);
}

export function objectOf(value: unknown, name: string): Json {
    check(typeof value === 'object' && value !== null && !Array.isArray(value), name, value, 'an object');
    return value as Json;
}

export function listOf(value: unknown, name: string): readonly unknown[] {
    check(Array.isArray(value), name, value, 'a list');
    return value;
}

/** A member of an object; undefined if there is none, or no object. */
export function memberOf(value: unknown, name: string): unknown {
    return (value as Json | null | undefined)?.[name];
}

export function textOf(value: unknown, name: string): string {
    check(typeof value === 'string', name, value, 'a text');
    return value;
}

/** A finite number. */
export function numberOf(value: unknown, name: string, least = -Infinity, most = Infinity): number {
    const fits = typeof value === 'number' && Number.isFinite(value) && value >= least && value <= most;
    check(fits, name, value, `a number from ${least} to ${most}`);
    return value;
}

/** A whole number. */
export function wholeOf(value: unknown, name: string, most = 2 ** 53): number {
    check(Number.isInteger(value), name, value, 'a whole number');
    return numberOf(value, name, 0, most);
}

/** A list of `count` finite numbers. */
export function numbersOf(value: unknown, name: string, count: number, least?: number, most?: number): number[] {
    const list = listOf(value, name);
    check(list.length === count, name, list, `${count} numbers`);
    return list.map((number) => numberOf(number, name, least, most));
}

export function choiceOf<T extends string>(value: unknown, name: string, choices: readonly T[]): T {
    check(choices.includes(value as T), name, value, choices.join(' or '));
    return value as T;
}
