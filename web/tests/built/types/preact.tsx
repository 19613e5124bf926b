import { createRef } from 'preact';
import type { LitetexViewerElement } from 'litetex/preact';
import 'litetex/preact';

const viewer = createRef<LitetexViewerElement>();
export const all = (
    <litetex-viewer
        key="one" ref={viewer} id="a" class="b" style={{ height: '70vh' }} onClick={() => viewer.current?.home()}
        src="scene.ltgs" alt="A still life" camera-controls controls-mode="fly" disable-zoom={false} auto-rotate={undefined}
        rotation-per-second={12} view="first" background="#123456" colours="texels" max-splats="5" precision="fast" keep-near={0.5} loading="lazy"
        onload={({ type }) => type} onprogress={({ loaded, total }) => loaded / total} onerror={({ message }) => message}
        oncamera-change={(event) => event.type}
    >
        <img slot="poster" src="poster.jpg" />
    </litetex-viewer>
);

export const wrong = [
    // @ts-expect-error: no such attribute
    <litetex-viewer source="scene.ltgs" />,
    // @ts-expect-error: no number
    <litetex-viewer max-splats="many" />,
    // @ts-expect-error: no such colours
    <litetex-viewer colours="red" />,
    // @ts-expect-error: an ErrorEvent has no such property
    <litetex-viewer onerror={({ loaded }) => loaded} />,
    // @ts-expect-error: another element's
    <litetex-viewer ref={createRef<HTMLVideoElement>()} />,
];
