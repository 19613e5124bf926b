/** `litetex/react` is `litetex/element`, with types for JSX of React 18 and 19. */

import type { DetailedHTMLProps, HTMLAttributes } from 'react';
import type { LitetexViewerElement } from './index';
import type { Optional, ViewerAttributes, ViewerHandlers } from './markup';

export * from './index';

type Html = DetailedHTMLProps<HTMLAttributes<LitetexViewerElement>, LitetexViewerElement>;

/** React listens under these names to its own elements only. */
type Deaf = 'onLoad' | 'onLoadCapture' | 'onError' | 'onErrorCapture' | 'onProgress' | 'onProgressCapture';

/** `use` came with React 19. React 18 gives elements such as this one no handlers, and `className` as an attribute of that name. */
type OfVersion = typeof import('react') extends { use: unknown } ? Pick<Html, 'className'> & ViewerHandlers : unknown;

export type LitetexViewerProps = Omit<Html, Deaf | 'className'> & OfVersion & Optional<ViewerAttributes> & { class?: string | undefined };

declare module 'react' {
    namespace JSX {
        interface IntrinsicElements {
            'litetex-viewer': LitetexViewerProps;
        }
    }
}
