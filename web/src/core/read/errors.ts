import { SceneError } from '../scene';

/** An error for a file that is damaged or breaks a rule of its format. */
export function invalid(what: string): SceneError {
  return new SceneError('invalid', what);
}

/** An error for a file of another kind, of a newer version, or larger than readers allow. */
export function unsupported(what: string): SceneError {
  return new SceneError('unsupported', what);
}

/** A text of the file for a message: short, quoted, and without control characters. */
export function quoted(text: unknown): string {
  const shown = JSON.stringify(text) ?? String(text);
  return shown.length > 60 ? `${shown.slice(0, 60)}...` : shown;
}
