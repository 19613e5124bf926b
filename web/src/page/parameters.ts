/** What the address of the page says: `?camera=NAME&controls=off&background=transparent&precision=exact&keep-near=0.3`. */

import { backgroundOf, precisionOf, reachOf } from '../element/attributes';
import type { Viewer } from '../viewer/viewer';

/** Applies what does not depend on a scene, written as the attributes of the element are. Returns the name of the camera to begin at. */
export function applyParameters(viewer: Viewer, search: string): string | null {
    const parameters = new URLSearchParams(search);
    const attributes = { getAttribute: (name: string) => parameters.get(name) };
    viewer.background = backgroundOf(attributes);
    viewer.precision = precisionOf(attributes);
    viewer.reach = reachOf(attributes);
    const { classList } = document.documentElement;
    classList.toggle('transparent', viewer.background === null);
    if (parameters.get('controls') === 'off') {
        viewer.controls.enabled = false;
        classList.add('bare');
    }
    return parameters.get('camera');
}
