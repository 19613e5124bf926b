'use client';

import { useEffect, useRef, useState } from 'react';
import type { LitetexViewerElement } from 'litetex/react';

/** The server renders the element as it stands here; the browser gives it its scene. */
export function Viewer({ src }: { src: string }) {
    const viewer = useRef<LitetexViewerElement>(null);
    const [state, setState] = useState('loading');
    useEffect(() => {
        // React gives no handlers to elements that a server has rendered.
        const element = viewer.current!;
        const loaded = () => setState('loaded');
        const failed = ({ message }: ErrorEvent) => setState(message);
        element.addEventListener('load', loaded);
        element.addEventListener('error', failed);
        import('litetex/element').catch((error) => setState(String(error)));
        return () => {
            element.removeEventListener('load', loaded);
            element.removeEventListener('error', failed);
        };
    }, []);
    return (
        <>
            <litetex-viewer ref={viewer} src={src} alt="A still life" camera-controls style={{ height: '70vh' }} />
            <p>{state}</p>
        </>
    );
}
