/** The page that shows a scene: served by the program, exported as one file, or opened empty to drop a file on. */

import { SceneError, type SceneInfo } from '../core/scene';
import { Viewer } from '../viewer/viewer';
import { Cameras } from './cameras';
import { ALL_COLOURS, setUpColours } from './colours';
import { Compare } from './compare';
import { byId, radios } from './dom';
import { save, setUpFiles } from './files';
import { bytes, fileName } from './format';
import { showFigures, showInfo } from './info';
import { setUpKeys, showHelp, type Shortcut } from './keys';
import { Measure } from './measure';
import { clear, closeLatest, say } from './messages';
import { closePanel, pressTool, setUpPanels } from './panels';
import { applyParameters } from './parameters';
import { embedded, type Session, sessionUrl, watch } from './session';
import { showTraining } from './training';

class Page {
    private readonly viewer: Viewer;
    private readonly cameras: Cameras;
    private readonly compare: Compare;
    private readonly measure: Measure;
    /** Name of the camera to begin at. */
    private camera: string | null;
    private session: Session | null = null;
    /** Name of the file that is shown or being read. */
    private name = '';
    /** Name of a file of the user's that is being read. */
    private pending = '';
    private revision = -1;
    /** What the program has sent is being read: a newer scene waits, else none would ever be done. */
    private reading = false;
    /** A file of the user's is shown, which what the program says is not about. */
    private own = false;

    constructor() {
        this.viewer = new Viewer(byId<HTMLCanvasElement>('canvas'), {
            info: (info) => this.begun(info),
            progress: (done, total) => this.progressed(done, total),
            load: () => this.loaded(),
            error: (error) => this.failed(error),
            camera: () => {
                this.cameras.moved();
                this.measure.draw();
            },
            drawn: (frame) => showFigures(this.viewer, frame),
            lost: () => this.stopped(),
            restored: () => clear('driver'),
        }, window);
        this.camera = applyParameters(this.viewer, location.search);
        this.compare = new Compare(this.viewer);
        this.measure = new Measure(this.viewer);
        const changed = () => this.compare.setCamera(this.cameras.current, this.cameras.exact);
        this.cameras = new Cameras(this.viewer, changed, () => (this.compare.mode === 'photo' ? 'back to the photo' : 'back'));
        this.setUpTools();
        setUpFiles((file) => void this.openFile(file));
        byId('canvas').focus({ preventScroll: true });
        this.start();
    }

    private start(): void {
        const inside = this.inside();
        const url = sessionUrl(new URL(location.href));
        if (inside) {
            this.session = inside.session;
            this.showTitle();
            this.wait('Reading the scene');
            this.viewer.open({ bytes: inside.bytes });
        } else if (url) {
            this.wait('Asking the program');
            watch(url, {
                session: (session, base) => this.told(session, base),
                lost: () => this.lost(),
                refused: () => this.refused(),
                none: () => this.welcome(),
            });
        } else {
            this.welcome();
        }
    }

    private inside(): ReturnType<typeof embedded> {
        try {
            return embedded();
        } catch {
            say('file', 'The scene in this page is damaged.', { error: true });
            return null;
        }
    }

    private welcome(): void {
        this.wait('');
        byId('welcome').hidden = false;
    }

    /** The program has said what there is. */
    private told(session: Session, base: URL): void {
        this.session = session;
        clear('program');
        if (this.own || this.pending) return;
        const { asset, photos, training } = session;
        showTraining(training);
        if (training?.state === 'stopped') say('training', `The training has stopped at step ${training.step} of ${training.steps}.`);
        else clear('training');
        this.compare.setPhotos(new Map((photos ?? []).map((photo) => [photo.view, new URL(photo.url, base).href])));
        if (asset?.url && asset.revision !== this.revision && !this.reading) {
            this.name = asset.name;
            this.revision = asset.revision;
            this.reading = true;
            if (!this.viewer.info) this.wait('Reading the scene');
            this.viewer.open({ url: new URL(asset.url, base).href }, { keepPose: this.viewer.info !== null });
        } else if (!asset) {
            if (training) this.wait(training.state === 'running' ? 'Waiting for the first scene of the training' : 'There is no scene');
            else this.welcome();
        }
        this.showTitle();
    }

    private lost(): void {
        say('program', 'The program has ended. What is shown stays, and changes no more.', { error: true, lasting: true });
        if (!this.viewer.info) this.wait('');
    }

    private refused(): void {
        say('program', 'This address is not, or no longer, valid: open the one that the program prints.', { error: true, lasting: true });
        if (!this.viewer.info) this.wait('');
        // The right address in the same window differs in the fragment only, which loads nothing by itself.
        addEventListener('hashchange', () => location.reload());
    }

    private async openFile(file: File): Promise<void> {
        clear('file');
        if (/\.x?html?$/i.test(file.name)) return say('file', `${file.name} is a page of its own: open it in the browser, as you would any page.`, { error: true });
        const content = await file.arrayBuffer().catch(() => null);
        if (!content) return say('file', `${file.name} cannot be read.`, { error: true });
        this.pending = file.name;
        this.reading = false;
        this.viewer.open({ bytes: content }, { whole: this.viewer.info !== null });
    }

    private begun(info: SceneInfo): void {
        this.measure.changed();
        if (this.pending) {
            this.name = this.pending;
            this.own = true;
            this.measure.clear();
            this.pending = '';
            this.compare.setPhotos(new Map());
            showTraining(null);
            clear('training');
        }
        byId('welcome').hidden = true;
        for (const tool of document.querySelectorAll<HTMLButtonElement>('#tools button')) tool.disabled = false;
        clear('file');
        if (info.untextured) say('textures', `Shown without textures: ${info.untextured}`);
        else clear('textures');
        showInfo(info, this.name);
        this.cameras.show(info);
        this.cameras.goNamed(this.camera);
        this.camera = null;
        this.showTitle();
    }

    private progressed(done: number, total: number): void {
        this.wait('');
        const bar = byId<HTMLProgressElement>('progress');
        bar.hidden = false;
        Object.assign(bar, { max: total, value: done });
        if (this.viewer.pose) this.cameras.moved();
    }

    private loaded(): void {
        this.reading = false;
        byId('progress').hidden = true;
        this.wait('');
    }

    private failed(error: Error): void {
        byId('progress').hidden = true;
        this.wait('');
        // What did not arrive is asked for again; what is damaged stays so.
        if (this.reading && !(error instanceof SceneError)) this.revision = -1;
        this.reading = false;
        const name = this.pending || this.name;
        this.pending = '';
        say('file', `${name ? `${name}: ` : ''}${error.message}`, { error: true });
        if (!this.viewer.info) byId('welcome').hidden = this.session !== null;
    }

    /** The browser has taken the context away. Once it is restored, the scene is made anew. */
    private stopped(): void {
        say('driver', 'The graphics driver has stopped. The scene comes back with it.', { error: true, lasting: true, action: { label: 'Reload', run: () => location.reload() } });
    }

    /** Says what is being waited for; nothing: a scene is there. */
    private wait(text: string): void {
        const element = byId('waiting');
        element.hidden = text === '' || this.viewer.info !== null;
        element.textContent = text;
    }

    private title(): string {
        const told = this.own ? '' : this.session?.title;
        return told || this.viewer.info?.provenance.title || this.name || 'litetex';
    }

    private showTitle(): void {
        const title = this.title();
        const size = this.viewer.info?.fileBytes;
        byId('title').textContent = title;
        document.title = title === 'litetex' ? title : `${title} – litetex`;
        byId('subtitle').textContent = [this.name === title ? '' : this.name, size ? bytes(size) : ''].filter(Boolean).join(', ');
    }

    private async screenshot(): Promise<void> {
        const camera = this.cameras.exact ? this.cameras.current!.name : '';
        try {
            save(await this.viewer.screenshot(), `${fileName(this.title(), camera)}.png`);
        } catch (error) {
            say('file', `The image cannot be saved: ${(error as Error).message}`, { error: true });
        }
    }

    private setUpTools(): void {
        const { viewer, cameras, compare, measure } = this;
        setUpPanels((name) => {
            if (name === 'cameras') cameras.reveal();
            measure.setOn(name === 'measure');
        });
        const colours = setUpColours((value) => {
            viewer.colours = value;
            viewer.invalidate();
        });
        const mode = radios(byId('mode'), [{ value: 'orbit', label: 'Orbit around the scene' }, { value: 'fly', label: 'Fly', key: 'F' }], 'orbit', (value) => {
            viewer.controls.mode = value;
        });
        const home = () => cameras.home();
        const fullscreen = () => void (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()).catch(() => {});
        byId('fullscreen').hidden = !document.fullscreenEnabled;
        byId('fullscreen').addEventListener('click', fullscreen);
        const figures = byId('figures'), statistics = byId<HTMLInputElement>('statistics');
        const showStatistics = () => { figures.hidden = !statistics.checked; };
        statistics.checked = innerWidth > 640;
        statistics.addEventListener('change', showStatistics);
        showStatistics();
        byId('home').addEventListener('click', home);
        byId('tool-save').addEventListener('click', () => void this.screenshot());
        byId('tool-help').addEventListener('click', showHelp);
        const shortcuts: Shortcut[] = [
            { keys: ['h'], help: 'back to the first view', run: home },
            { keys: ['f'], help: 'orbit or fly', run: () => mode.choose(viewer.controls.mode === 'fly' ? 'orbit' : 'fly') },
            { keys: ['n', 'p'], help: 'next or previous camera', run: (key) => cameras.step(key === 'n' ? 1 : -1) },
            { keys: ['b'], help: 'back to the camera', run: () => cameras.back() },
            { keys: ['c'], help: 'compare: nothing, without textures, photo', run: () => compare.next() },
            { keys: ['1', '2', '3', '4', '5'], help: 'colours: as trained, without textures, texels, SH degree, depth', run: (key) => colours(ALL_COLOURS[Number(key) - 1]) },
            { keys: ['l'], help: 'list of cameras', run: () => pressTool('cameras') },
            { keys: ['m'], help: 'measure between two points', run: () => pressTool('measure') },
            { keys: ['i'], help: 'information', run: () => pressTool('info') },
            { keys: ['t'], help: 'statistics', run: () => statistics.click() },
            { keys: ['z'], help: 'whole screen, and back', run: fullscreen },
            { keys: ['x'], help: 'save the image', run: () => void this.screenshot() },
            { keys: ['?'], help: 'these keys; Escape closes', run: showHelp },
        ];
        setUpKeys(shortcuts, () => closePanel() || closeLatest());
    }
}

// The style sheet says that nothing runs, unless something does.
document.documentElement.classList.add('running');
try {
    new Page();
} catch (error) {
    const text = (error as Error).message;
    say('driver', `The scene cannot be drawn: ${text}. Another browser may do, or this one with hardware acceleration switched on.`, { error: true, lasting: true });
}
