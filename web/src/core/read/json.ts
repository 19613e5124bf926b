import { invalid, quoted } from './errors';

/** A JSON object of a file, whose members are not checked yet. */
export type Json = Readonly<Record<string, unknown>>;

const typeOf = (value: unknown): string => (value === undefined ? 'nothing' : value === null ? 'null' : Array.isArray(value) ? 'a list' : typeof value);

function wrong(name: string, value: unknown, expected: string): Error {
  const found = typeof value === 'number' || typeof value === 'string' ? quoted(value) : typeOf(value);
  return invalid(`${name}: found ${found}, expected ${expected}`);
}

/** Parses a text as one JSON object. `name` is for messages, as in all functions here. */
export function parseJson(text: string | null, name: string): Json {
  if (text === null) throw invalid(`${name}: not a text of UTF-8`);
  let value: unknown;
  try {
    value = JSON.parse(text);
  } catch (error) {
    throw invalid(`${name}: ${error instanceof Error ? error.message.slice(0, 100) : 'not JSON'}`);
  }
  return objectOf(value, name);
}

export function objectOf(value: unknown, name: string): Json {
  if (typeOf(value) !== 'object') throw wrong(name, value, 'an object');
  return value as Json;
}

export function listOf(value: unknown, name: string): readonly unknown[] {
  if (!Array.isArray(value)) throw wrong(name, value, 'a list');
  return value;
}

export function textOf(value: unknown, name: string): string {
  if (typeof value !== 'string') throw wrong(name, value, 'a text');
  return value;
}

export function numberOf(value: unknown, name: string): number {
  if (typeof value !== 'number' || !Number.isFinite(value)) throw wrong(name, value, 'a finite number');
  return value;
}

/** A whole number from 0 to `most`. */
export function wholeOf(value: unknown, name: string, most = Number.MAX_SAFE_INTEGER): number {
  if (!Number.isInteger(value) || (value as number) < 0 || (value as number) > most) throw wrong(name, value, `a whole number up to ${most}`);
  return value as number;
}

/** A list of `count` finite numbers. */
export function numbersOf(value: unknown, name: string, count: number): number[] {
  const list = listOf(value, name);
  if (list.length !== count) throw wrong(name, list.length, `${count} numbers`);
  return list.map((number) => numberOf(number, name));
}

export function choiceOf<T extends string>(value: unknown, name: string, choices: readonly T[]): T {
  const found = choices.find((choice) => choice === value);
  if (found === undefined) throw wrong(name, value, choices.join(' or '));
  return found;
}
