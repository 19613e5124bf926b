/** `litetex/vue` is `litetex/element`, with types for templates of Vue. */

import type { HTMLAttributes, PublicProps } from 'vue';
import type { LitetexViewerElement } from './index';
import type { Optional, ViewerAttributes, ViewerEvents } from './markup';

export * from './index';

/** As templates name attributes when they are checked: `cameraControls` for `camera-controls`. */
type Camel<Name extends string> = Name extends `${infer Before}-${infer After}` ? `${Before}${Capitalize<Camel<After>>}` : Name;

type Attributes = Optional<{ [Name in keyof ViewerAttributes as Camel<Name>]: ViewerAttributes[Name] }>;
type Handlers = Optional<{ [Name in keyof ViewerEvents as `on${Capitalize<Camel<Name>>}`]: (event: ViewerEvents[Name]) => void }>;

export type LitetexViewerProps = Omit<HTMLAttributes, keyof Attributes | keyof Handlers> & PublicProps & Attributes & Handlers;

declare module 'vue' {
    interface GlobalComponents {
        'litetex-viewer': new () => LitetexViewerElement & { $props: LitetexViewerProps };
    }
}
