/** Where the scene comes from, and figures of its file and its drawing. */

import type { SceneInfo } from '../core/scene';
import type { FrameFigures, Viewer } from '../viewer/viewer';
import { byId, fillFacts } from './dom';
import { bytes, count, milliseconds } from './format';

const CONTAINERS = { ltgs: '.ltgs', gltf: 'glTF' } as const;

/** Shows what a file says about itself. */
export function showInfo(info: SceneInfo, name: string): void {
    const { title, author, licence, source, up, scale, programVersion, training } = info.provenance;
    fillFacts(byId('provenance'), [['Title', title || '–'], ['Author', author], ['Licence', licence], ['Source', source], ['Up', up], ['Scale', scale], ['Made by', programVersion && `litetex ${programVersion}`]]);
    fillFacts(byId('file-facts'), [
        ['Name', name], ['Format', CONTAINERS[info.container]], ['Quality', info.quality], ['Size', bytes(info.fileBytes)], ['Splats', count(info.splats)],
        ['Texels', count(info.texels)], ['SH degree', `up to ${info.shDegree}`], ['Cameras', count(info.cameras.length)],
    ]);
    const settings = Object.entries(training).map(([key, value]) => [words(key), String(value)] as const);
    byId('training-settings').hidden = settings.length === 0;
    fillFacts(byId('training-settings').querySelector('dl')!, settings);
}

/** Shows figures of the image just drawn. */
export function showFigures(viewer: Viewer, frame: FrameFigures): void {
    const { figures } = viewer.renderer;
    const size = `${count(frame.widthPx)} × ${count(frame.heightPx)} px`;
    fillFacts(byId('drawing'), [
        ['Image', size], ['Time of an image', milliseconds(frame.ms)], ['Time of the last sort', milliseconds(figures.sortMs)],
        ['On the GPU', bytes(figures.bytes)],
    ]);
    const parts = [
        milliseconds(frame.ms), size, `${count(figures.splats)} splats`, `${count(figures.texels)} texels`,
        `file ${bytes(viewer.info?.fileBytes ?? 0)}`, `GPU ${bytes(figures.bytes)}`, `sort ${milliseconds(figures.sortMs)}`,
    ];
    byId('figures').textContent = parts.join(' · ');
}

/** `psnr_test` or `psnrTest` as words. */
const words = (key: string): string => key.replace(/([a-z])([A-Z])/g, '$1 $2').replace(/_/g, ' ').replace(/^./, (c) => c.toUpperCase())
    .replace(/\b(psnr|ssim|flip|sh)\b/gi, (name) => name.toUpperCase());
