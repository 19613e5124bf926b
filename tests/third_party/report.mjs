// One line per judge on standard output; exit code 1 if anything is wrong.

/** Ends a judge: `figures` if nothing is wrong, else the problems. */
export function finish(name, figures, problems) {
    for (const problem of problems) console.log(`  ${name}: ${problem}`);
    console.log(`${name}: ${problems.length ? `FAILED, ${problems.length} problems` : figures}`);
    process.exit(problems.length ? 1 : 0);
}
