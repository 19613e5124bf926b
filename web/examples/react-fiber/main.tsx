import { Canvas, useThree } from '@react-three/fiber';
import { useEffect, useState } from 'react';
import { createRoot } from 'react-dom/client';
import type { PerspectiveCamera } from 'three';
import { LitetexLoader, type LitetexSplats } from 'litetex/three';

/** The splats of a file, once its first layer is there; they are disposed of with the component. */
function useSplats(url: string): LitetexSplats | null {
    const [splats, setSplats] = useState<LitetexSplats | null>(null);
    useEffect(() => {
        const loading = new LitetexLoader().loadAsync(url);
        loading.then(setSplats, console.error);
        return () => {
            setSplats(null);
            loading.then((loaded) => loaded.dispose(), () => {});
        };
    }, [url]);
    return splats;
}

function Splats({ url }: { url: string }) {
    const splats = useSplats(url);
    const { camera, invalidate } = useThree();
    useEffect(() => {
        if (!splats) return;
        splats.takeCamera(camera as PerspectiveCamera, splats.info.cameras[splats.info.home ?? 0]);
        splats.onUpdate = () => invalidate(); // layers and orders arrive
        invalidate();
    }, [splats, camera, invalidate]);
    return splats && <primitive object={splats} />;
}

function App() {
    const [shown, setShown] = useState(true);
    return (
        <>
            {shown && <Canvas frameloop="demand"><Splats url="scene.ltgs" /></Canvas>}
            <label><input type="checkbox" checked={shown} onChange={() => setShown(!shown)} /> shown</label>
        </>
    );
}

createRoot(document.getElementById('app')!).render(<App />);
