import 'litetex/react';

export const all = (
    <litetex-viewer
        className="b" onload={({ type }) => type} onprogress={({ loaded, total }) => loaded / total} onerror={({ message }) => message}
        oncamera-change={(event) => event.type}
    />
);
// @ts-expect-error: an ErrorEvent has no such property
export const wrong = <litetex-viewer onerror={({ loaded }) => loaded} />;
