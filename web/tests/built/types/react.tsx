import { useRef } from 'react';
import type { LitetexViewerElement } from 'litetex/react';
import 'litetex/react';

export function All() {
    const viewer = useRef<LitetexViewerElement>(null);
    return (
        <litetex-viewer
            key="one" ref={viewer} id="a" class="b" style={{ height: '70vh' }} aria-describedby="c" onClick={() => viewer.current?.home()}
            src="scene.ltgs" alt="A still life" camera-controls controls-mode="fly" disable-zoom={false} auto-rotate={undefined}
            rotation-per-second={12} view="first" background="#123456" colours="texels" max-splats="5" precision="fast" keep-near={0.5} loading="lazy"
        >
            <img slot="poster" src="poster.jpg" />
        </litetex-viewer>
    );
}

export const wrong = [
    // @ts-expect-error: no such attribute
    <litetex-viewer source="scene.ltgs" />,
    // @ts-expect-error: no number
    <litetex-viewer max-splats="many" />,
    // @ts-expect-error: no such colours
    <litetex-viewer colours="red" />,
    // @ts-expect-error: React hears load under this name from its own elements only
    <litetex-viewer onLoad={() => {}} />,
    // @ts-expect-error: another element's
    <litetex-viewer ref={useRef<HTMLVideoElement>(null)} />,
];
