import type { GlobalComponents } from 'vue';
import type { LitetexViewerElement } from 'litetex/vue';
import 'litetex/vue';

/** Templates are checked like this: names without hyphens, events with `on`. */
declare const Viewer: GlobalComponents['litetex-viewer'];
const viewer: LitetexViewerElement = new Viewer();

export const all = (
    <Viewer
        key="one" id="a" class="b" style={{ height: '70vh' }} aria-describedby="c" onClick={() => viewer.home()}
        src="scene.ltgs" alt="A still life" cameraControls controlsMode="fly" disableZoom={false} autoRotate={undefined}
        rotationPerSecond={12} view="first" background="#123456" colours="texels" maxSplats="5" precision="fast" keepNear={0.5} loading="lazy"
        onLoad={({ type }) => type} onProgress={({ loaded, total }) => loaded / total} onError={({ message }) => message}
        onCameraChange={(event) => event.type}
    />
);

export const wrong = [
    // @ts-expect-error: no such attribute
    <Viewer source="scene.ltgs" />,
    // @ts-expect-error: no number
    <Viewer maxSplats="many" />,
    // @ts-expect-error: no such colours
    <Viewer colours="red" />,
    // @ts-expect-error: an ErrorEvent has no such property
    <Viewer onError={({ loaded }) => loaded} />,
];
