import { Viewer } from './viewer';

export default function Page() {
    return (
        <main>
            <h1>A still life</h1>
            <Viewer src="/scene.ltgs" />
        </main>
    );
}
