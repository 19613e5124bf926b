import 'litetex/react';

export const wrong = [
    // @ts-expect-error: React 18 adds no listeners
    <litetex-viewer onload={() => {}} />,
    // @ts-expect-error: React 18 writes an attribute of that name
    <litetex-viewer className="b" />,
];
