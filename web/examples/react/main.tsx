import { useRef, useState } from 'react';
import { createRoot } from 'react-dom/client';
import type { LitetexViewerElement } from 'litetex/react';
import 'litetex/react';

function App() {
    const viewer = useRef<LitetexViewerElement>(null);
    const [shown, setShown] = useState(true);
    const [turns, setTurns] = useState(false);
    const [names, setNames] = useState<string[]>([]);
    return (
        <>
            {shown && <litetex-viewer
                ref={viewer} src="scene.ltgs" alt="A still life" camera-controls auto-rotate={turns}
                onload={() => setNames(viewer.current!.info!.cameras.map(({ name }) => name))}
                onerror={({ message }) => console.error(message)}
            />}
            <label><input type="checkbox" checked={shown} onChange={() => setShown(!shown)} /> shown</label>
            <label><input type="checkbox" checked={turns} onChange={() => setTurns(!turns)} /> turns</label>
            {names.map((name) => <button key={name} onClick={() => viewer.current?.goTo(name)}>{name}</button>)}
        </>
    );
}

createRoot(document.getElementById('app')!).render(<App />);
