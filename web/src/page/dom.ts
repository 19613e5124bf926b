/** Elements of the page. Text goes in as text, never as markup: titles and names come from files. */

/** The element of the page with this id. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
    return document.getElementById(id) as T;
}

/** Makes an element with children or text. */
export function make<K extends keyof HTMLElementTagNameMap>(
    tag: K, properties: Partial<HTMLElementTagNameMap[K]> = {}, ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
}

/** Makes an element of an SVG image. */
export function makeSvg(tag: string, attributes: Record<string, string | number>, ...children: Node[]): SVGElement {
    const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
    element.append(...children);
    return element;
}

/** Fills a list of facts; those without a value are left out. Keeps elements whose text is the same. */
export function fillFacts(list: Element, facts: readonly (readonly [name: string, value: string])[]): void {
    const rows = facts.filter(([, value]) => value !== '');
    const texts = rows.flat();
    if (texts.length === list.children.length && texts.every((text, i) => list.children[i].textContent === text)) return;
    list.replaceChildren(...rows.flatMap(([name, value]) => [make('dt', {}, name), make('dd', {}, value)]));
}

/** Fills a set of radio buttons; `changed` gets the value chosen. Returns what chooses one from outside. */
export function radios<T extends string>(
    fieldset: HTMLElement, options: readonly { value: T; label: string; key?: string }[], first: T, changed: (value: T) => void,
): { choose(value: T): void; enable(value: T, enabled: boolean): void } {
    const inputs = new Map<T, HTMLInputElement>();
    for (const { value, label, key } of options) {
        const input = make('input', { type: 'radio', name: fieldset.id, value, checked: value === first });
        input.addEventListener('change', () => changed(value));
        inputs.set(value, input);
        fieldset.append(make('label', {}, input, label, ...(key ? [make('small', {}, key)] : [])));
    }
    return {
        choose(value) {
            inputs.get(value)!.checked = true;
            changed(value);
        },
        enable: (value, enabled) => { inputs.get(value)!.disabled = !enabled; },
    };
}
