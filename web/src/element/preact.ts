/** `litetex/preact` is `litetex/element`, with types for JSX of Preact. */

import type { HTMLAttributes } from 'preact';
import type { LitetexViewerElement } from './index';
import type { Optional, ViewerAttributes, ViewerHandlers } from './markup';

export * from './index';

export type LitetexViewerProps = Omit<HTMLAttributes<LitetexViewerElement>, keyof ViewerAttributes> & Optional<ViewerAttributes> & ViewerHandlers;

declare module 'preact' {
    namespace JSX {
        interface IntrinsicElements {
            'litetex-viewer': LitetexViewerProps;
        }
    }
}
