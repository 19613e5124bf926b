/** Takes results in their order, wherever they come from: at once, or when they and all before them are there. */
export class Queue {
    /** Rejects with the first error, in order. */
    readonly failed: Promise<never>;
    private fail!: (error: unknown) => void;
    private last: Promise<void> = Promise.resolve();
    private pending = 0;

    /** `onEmpty` is called when all that was pending is taken. */
    constructor(private readonly onEmpty: () => void) {
        this.failed = new Promise((_, reject) => (this.fail = reject));
        this.failed.catch(() => {});
    }

    get isEmpty(): boolean {
        return this.pending === 0;
    }

    add<T>(result: T | Promise<T>, take: (value: T) => void): void {
        if (this.isEmpty && !(result instanceof Promise)) return take(result);
        this.pending += 1;
        const own = Promise.resolve(result);
        own.catch(() => {}); // told of in its turn
        this.last = this.last.then(() => own).then((value) => {
            take(value);
            this.pending -= 1;
            if (this.isEmpty) this.onEmpty();
        });
        this.last.catch(this.fail);
    }

    /** Resolves when all is taken, or rejects as `failed`. */
    settled(): Promise<void> {
        return this.last;
    }

    /** Waits for something else, unless a result fails before. */
    orFailed<T>(other: Promise<T>): Promise<T> {
        return Promise.race([other, this.failed]);
    }
}
